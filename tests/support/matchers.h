// SPDX-License-Identifier: Apache-2.0
// Matchers for Status and StatusOr.
#pragma once

#include <ostream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/status.h"

namespace loci {

inline void PrintTo(const Status& status, std::ostream* out) {
  *out << status.ToString();
}

namespace internal {

inline const Status& StatusOf(const Status& status) {
  return status;
}
template <typename T>
const Status& StatusOf(const StatusOr<T>& status_or) {
  return status_or.status();
}

}  // namespace internal

// EXPECT_THAT(status_or, IsOk());
MATCHER(IsOk, negation ? "is an error" : "is OK") {
  const Status& status = internal::StatusOf(arg);
  *result_listener << status.ToString();
  return status.ok();
}

// EXPECT_THAT(status, IsStatus(StatusCode::kInvalidArgument, "odometry.stamp_ns"));
MATCHER_P2(IsStatus, code, part_of_message, "has the code and this part in its message") {
  const Status& status = internal::StatusOf(arg);
  *result_listener << status.ToString();
  return status.code() == code &&
         status.message().find(std::string(part_of_message)) != std::string::npos;
}

// EXPECT_THAT(status, IsStatus(StatusCode::kNotFound));
MATCHER_P(IsStatus, code, "has the code") {
  const Status& status = internal::StatusOf(arg);
  *result_listener << status.ToString();
  return status.code() == code;
}

}  // namespace loci
