// SPDX-License-Identifier: Apache-2.0
// Time as the server sees it: handed in, so that tests own it.
#pragma once

#include <atomic>
#include <chrono>

namespace loci {

using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::steady_clock::duration;

// A clock that never goes back. Any thread may call.
class Clock {
 public:
  virtual ~Clock() = default;
  virtual TimePoint Now() const = 0;
};

// The machine's.
class SteadyClock : public Clock {
 public:
  TimePoint Now() const override { return std::chrono::steady_clock::now(); }
};

// Stands still until a test moves it.
class ManualClock : public Clock {
 public:
  TimePoint Now() const override { return TimePoint(Duration(since_start_.load())); }
  void Advance(Duration duration) { since_start_.fetch_add(duration.count()); }

 private:
  // Not at the epoch, so that "some time ago" does not fall before the first instant.
  std::atomic<Duration::rep> since_start_{Duration(std::chrono::hours(1)).count()};
};

}  // namespace loci
