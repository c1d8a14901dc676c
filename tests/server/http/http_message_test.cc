// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace loci {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

TEST(HttpTargetTest, SplitsPathAndQuery) {
  const StatusOr<HttpRequest> request = ParseHttpTarget("/maps/hall%2d1?revision=7&a=%26");
  ASSERT_TRUE(request.ok());
  EXPECT_THAT(request->path, ElementsAre("maps", "hall-1"));
  EXPECT_THAT(request->query, ElementsAre(Pair("a", "&"), Pair("revision", "7")));
}

TEST(HttpTargetTest, FrontPageIsTheEmptyPathAndATrailingSlashIsNoSegment) {
  EXPECT_THAT(ParseHttpTarget("/")->path, IsEmpty());
  EXPECT_THAT(ParseHttpTarget("/maps/")->path, ElementsAre("maps"));
}

TEST(HttpTargetTest, AnEscapedSlashStaysInItsSegment) {
  EXPECT_THAT(ParseHttpTarget("/a%2fb/c")->path, ElementsAre("a/b", "c"));
}

class BadTargetTest : public ::testing::TestWithParam<const char*> {};

TEST_P(BadTargetTest, IsRefused) {
  const StatusOr<HttpRequest> request = ParseHttpTarget(GetParam());
  ASSERT_FALSE(request.ok());
  EXPECT_EQ(request.status().code(), StatusCode::kInvalidArgument);
}

INSTANTIATE_TEST_SUITE_P(All,
                         BadTargetTest,
                         ::testing::Values("",
                                           "maps",
                                           "http://else.where/",
                                           "/..",
                                           "/maps/../../etc/passwd",
                                           "/maps/%2e%2e/x",
                                           "/maps/.%2E/x",
                                           "/./x",
                                           "/a%",
                                           "/a%2",
                                           "/a%zz",
                                           "/a%+1",
                                           "/a%00b",
                                           "/a%0d%0aX-Evil: 1",
                                           "/a%7f",
                                           "/a?b=%00",
                                           "/a?revision=1&revision=2"));

TEST(EtagTest, MatchesInListsWeaklyAndByStar) {
  EXPECT_TRUE(EtagMatches("\"a\"", "\"a\""));
  EXPECT_TRUE(EtagMatches("\"x\", W/\"a\"", "\"a\""));
  EXPECT_TRUE(EtagMatches("*", "\"a\""));
  EXPECT_FALSE(EtagMatches("", "\"a\""));
  EXPECT_FALSE(EtagMatches("\"b\",a,\"", "\"a\""));
}

TEST(ErrorResponseTest, CarriesTheMessageAndTellsWhenToTryAgain) {
  const HttpResponse unknown = ErrorResponse(NotFoundError("map: \"x\" is not here"));
  EXPECT_EQ(unknown.status, 404U);
  EXPECT_THAT(*unknown.body, HasSubstr("map: \"x\" is not here"));
  const HttpResponse busy = ErrorResponse(UnavailableError("recovering"));
  EXPECT_EQ(busy.status, 503U);
  EXPECT_THAT(busy.headers, ElementsAre(Pair("Retry-After", "1")));
}

}  // namespace
}  // namespace loci
