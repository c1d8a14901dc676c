// SPDX-License-Identifier: Apache-2.0
// Time for the server's own purposes (deadlines, intervals, ages): never for a map's state.
#pragma once

#include <atomic>
#include <chrono>

namespace loci {

// A clock that never goes back and is not set by anyone. Thread-safe.
class Clock {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<Clock, Duration>;  // since an arbitrary start

  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  virtual ~Clock() = default;
  virtual Time Now() const = 0;
};

class SystemClock final : public Clock {
 public:
  Time Now() const override { return Time(std::chrono::steady_clock::now().time_since_epoch()); }
};

// A clock for tests: stands still until it is moved.
class ManualClock final : public Clock {
 public:
  Time Now() const override { return Time(Duration(now_ns_.load())); }
  void Advance(Duration duration) { now_ns_ += duration.count(); }

 private:
  std::atomic<Duration::rep> now_ns_{0};
};

}  // namespace loci
