// SPDX-License-Identifier: Apache-2.0
// When a call must be over.
#pragma once

#include <cstdint>
#include <optional>

#include "server/base/clock.h"

namespace loci {

// An instant, or never.
class Deadline {
 public:
  // Never.
  Deadline() = default;

  // `timeout_us` after `now`, the arrival of the request; 0 is never. Negative ones have passed.
  // Clocks of two machines need not agree, because only a length of time travels.
  static Deadline FromTimeout(std::int64_t timeout_us, TimePoint now);
  static Deadline At(TimePoint time);

  bool never() const { return !time_.has_value(); }
  // Undefined for one that never comes.
  TimePoint time() const { return *time_; }
  bool HasPassed(TimePoint now) const { return time_.has_value() && *time_ <= now; }

 private:
  std::optional<TimePoint> time_;
};

}  // namespace loci
