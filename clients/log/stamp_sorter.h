// SPDX-License-Identifier: Apache-2.0
// Puts scans in order of their stamps within a window.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "clients/log/log_scan.h"

namespace loci {

// Loggers write messages as they arrive, and stamps may go back a little. A scan waits here until
// one that is newer by the window has come; so what comes out is in order, unless a stamp goes back
// by more than the window: such a scan comes out at its turn in the file and is counted as late.
// Scans of one stamp keep their order.
class StampSorter {
 public:
  static constexpr std::int64_t kWindowNs = 2'000'000'000;

  explicit StampSorter(std::int64_t window_ns = kWindowNs) : window_ns_(window_ns) {}

  void Push(LogScan scan);
  // No more scans come: what waits may go.
  void Finish() { finished_ = true; }
  // The next scan, if it need not wait any longer.
  std::optional<LogScan> Pop();

  // Scans that came after one with a later stamp and were moved before it.
  std::size_t moved_count() const { return moved_count_; }
  // Scans that came more than the window too late, and are out of order now.
  std::size_t late_count() const { return late_count_; }

 private:
  std::int64_t window_ns_;
  std::deque<LogScan> waiting_;  // in order of stamp
  std::deque<LogScan> late_;
  std::optional<std::int64_t> newest_ns_;
  std::optional<std::int64_t> last_popped_ns_;
  std::size_t moved_count_ = 0;
  std::size_t late_count_ = 0;
  bool finished_ = false;
};

}  // namespace loci
