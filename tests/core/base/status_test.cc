// SPDX-License-Identifier: Apache-2.0
#include "core/base/status.h"

#include <memory>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace loci {
namespace {

StatusOr<int> Half(int number) {
  if (number % 2 != 0) {
    return InvalidArgumentError("number: " + std::to_string(number) + ", must be even");
  }
  return number / 2;
}

StatusOr<int> Quarter(int number) {
  LOCI_ASSIGN_OR_RETURN(const int half, Half(number));
  LOCI_ASSIGN_OR_RETURN(const int quarter, Half(half));
  return quarter;
}

Status CheckQuarter(int number, int& checked) {
  LOCI_RETURN_IF_ERROR(Quarter(number).status());
  ++checked;
  return {};
}

TEST(StatusTest, OkHasNoMessageAndErrorsKeepTheirs) {
  EXPECT_TRUE(Status().ok());
  EXPECT_EQ(Status().ToString(), "OK");
  const Status status = NotFoundError("map \"a\": no such map");
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(status.code(), StatusCode::kNotFound);
  EXPECT_EQ(status.message(), "map \"a\": no such map");
  EXPECT_EQ(status.ToString(), "NOT_FOUND: map \"a\": no such map");
}

TEST(StatusTest, EveryCodeHasItsOwnName) {
  std::set<std::string_view> names;
  for (int code = 0; code <= 16; ++code) {
    names.insert(StatusCodeName(static_cast<StatusCode>(code)));
  }
  EXPECT_EQ(names.size(), 17U);
}

TEST(StatusTest, MacrosLeaveWithTheFirstErrorAndGoOnWithoutOne) {
  EXPECT_EQ(*Quarter(12), 3);
  EXPECT_THAT(Quarter(7), IsStatus(StatusCode::kInvalidArgument, "number: 7"));
  EXPECT_THAT(Quarter(14), IsStatus(StatusCode::kInvalidArgument, "number: 7"));
  int checked = 0;
  EXPECT_THAT(CheckQuarter(8, checked), IsOk());
  EXPECT_EQ(checked, 1);
  EXPECT_THAT(CheckQuarter(9, checked), IsStatus(StatusCode::kInvalidArgument));
  EXPECT_EQ(checked, 1);
}

TEST(StatusTest, ValuesThatOnlyMoveGoThrough) {
  const auto make = []() -> StatusOr<std::unique_ptr<int>> { return std::make_unique<int>(5); };
  const auto take = [&]() -> StatusOr<int> {
    LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<int> number, make());
    return *number;
  };
  EXPECT_EQ(*take(), 5);
}

TEST(StatusDeathTest, TakingTheValueOfAnErrorEndsTheProcess) {
  const StatusOr<int> error = Half(1);
  EXPECT_DEATH(error.value(), "ok\\(\\)");
  EXPECT_DEATH(StatusOr<int>{Status()}, "status_.ok");
}

}  // namespace
}  // namespace loci
