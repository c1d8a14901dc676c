// SPDX-License-Identifier: Apache-2.0
// When a call must be over.
#include "server/rpc/deadline.h"

#include <algorithm>
#include <chrono>

namespace loci {

Deadline Deadline::FromTimeout(std::int64_t timeout_us, TimePoint now) {
  if (timeout_us == 0) {
    return {};
  }
  // A year is for ever, and keeps the sum from overflowing.
  constexpr std::int64_t kLongestUs = std::int64_t{366} * 24 * 3600 * 1'000'000;
  const std::int64_t bounded_us = std::clamp(timeout_us, std::int64_t{0}, kLongestUs);
  return At(now + std::chrono::microseconds(bounded_us));
}

Deadline Deadline::At(TimePoint time) {
  Deadline deadline;
  deadline.time_ = time;
  return deadline;
}

}  // namespace loci
