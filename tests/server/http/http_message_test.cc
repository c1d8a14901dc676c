// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_message.h"

#include <algorithm>
#include <string>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

bool IsPrintable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) {
    return static_cast<unsigned char>(c) >= 0x20 && c != 0x7f;
  });
}

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

TEST(HttpTargetTest, AnyBytesAreRefusedOrGiveNamesWithoutControlCharacters) {
  constexpr std::string_view kBytes = "/%?&=.2eEfF07aZ \n\r\x7f\x80\xff";
  RandomSequence random(31);
  int refused = 0;
  for (int round = 0; round < 20'000; ++round) {
    std::string target = "/";
    for (std::uint64_t i = random.NextBits() % 24; i > 0; --i) {
      target += kBytes[random.NextBits() % kBytes.size()];
    }
    const StatusOr<HttpRequest> request = ParseHttpTarget(target);
    if (!request.ok()) {
      EXPECT_EQ(request.status().code(), StatusCode::kInvalidArgument) << target;
      ++refused;
      continue;
    }
    for (const std::string& segment : request->path) {
      EXPECT_NE(segment, ".") << target;
      EXPECT_NE(segment, "..") << target;
      EXPECT_TRUE(IsPrintable(segment)) << target;
    }
    for (const auto& [key, value] : request->query) {
      EXPECT_TRUE(IsPrintable(key) && IsPrintable(value)) << target;
    }
  }
  EXPECT_GT(refused, 1000);
  EXPECT_LT(refused, 19'000);
}

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
