// SPDX-License-Identifier: Apache-2.0
// Outcome of an operation that the world can make fail: input, disk, network.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/base/check.h"

namespace loci {

// The canonical codes of gRPC; the numbers are those of the wire and never change.
enum class StatusCode : std::uint8_t {
  kOk = 0,
  kCancelled = 1,
  kUnknown = 2,
  kInvalidArgument = 3,
  kDeadlineExceeded = 4,
  kNotFound = 5,
  kAlreadyExists = 6,
  kPermissionDenied = 7,
  kResourceExhausted = 8,
  kFailedPrecondition = 9,
  kAborted = 10,
  kOutOfRange = 11,
  kUnimplemented = 12,
  kInternal = 13,
  kUnavailable = 14,
  kDataLoss = 15,
  kUnauthenticated = 16,
};

// "INVALID_ARGUMENT" and so on.
std::string_view StatusCodeName(StatusCode code);

// Success, or a code and a message that names field, value and what is allowed.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(StatusCode code, std::string message) : code_(code), message_(std::move(message)) {}

  bool ok() const { return code_ == StatusCode::kOk; }
  StatusCode code() const { return code_; }
  const std::string& message() const { return message_; }
  // "INVALID_ARGUMENT: odometry.covariance: ..." or "OK".
  std::string ToString() const;

 private:
  StatusCode code_ = StatusCode::kOk;
  std::string message_;
};

// A T, or the reason why there is none.
template <typename T>
class [[nodiscard]] StatusOr {
 public:
  StatusOr(T value) : value_(std::move(value)) {}         // NOLINT(google-explicit-constructor)
  StatusOr(Status status) : status_(std::move(status)) {  // NOLINT(google-explicit-constructor)
    LOCI_CHECK(!status_.ok());
  }

  bool ok() const { return value_.has_value(); }
  const Status& status() const { return status_; }
  const T& value() const& {
    LOCI_CHECK(ok());
    return *value_;
  }
  T& value() & {
    LOCI_CHECK(ok());
    return *value_;
  }
  T&& value() && {
    LOCI_CHECK(ok());
    return *std::move(value_);
  }
  const T* operator->() const { return &value(); }
  T* operator->() { return &value(); }
  const T& operator*() const& { return value(); }
  T& operator*() & { return value(); }

 private:
  Status status_;
  std::optional<T> value_;
};

Status CancelledError(std::string message);
Status InvalidArgumentError(std::string message);
Status DeadlineExceededError(std::string message);
Status NotFoundError(std::string message);
Status AlreadyExistsError(std::string message);
Status PermissionDeniedError(std::string message);
Status ResourceExhaustedError(std::string message);
Status FailedPreconditionError(std::string message);
Status OutOfRangeError(std::string message);
Status UnimplementedError(std::string message);
Status InternalError(std::string message);
Status UnavailableError(std::string message);
Status DataLossError(std::string message);

// Drops a status on purpose; the reason is for the reader, and a search finds every place.
inline void IgnoreError(const Status& /*status*/, std::string_view /*reason*/) {}

}  // namespace loci

#define LOCI_STATUS_CONCAT_INNER(a, b) a##b
#define LOCI_STATUS_CONCAT(a, b) LOCI_STATUS_CONCAT_INNER(a, b)

// Leaves the function with the status of `expression` unless it is OK.
#define LOCI_RETURN_IF_ERROR(expression)                                \
  do {                                                                  \
    if (::loci::Status loci_status = (expression); !loci_status.ok()) { \
      return loci_status;                                               \
    }                                                                   \
  } while (false)

// LOCI_ASSIGN_OR_RETURN(const Scan scan, DecodeScan(bytes));
#define LOCI_ASSIGN_OR_RETURN(declaration, expression) \
  LOCI_ASSIGN_OR_RETURN_INNER(                         \
      LOCI_STATUS_CONCAT(loci_status_or_, __LINE__), declaration, expression)
#define LOCI_ASSIGN_OR_RETURN_INNER(temporary, declaration, expression) \
  auto temporary = (expression);                                        \
  if (!temporary.ok()) {                                                \
    return temporary.status();                                          \
  }                                                                     \
  declaration = std::move(temporary).value()
