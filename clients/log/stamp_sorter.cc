// SPDX-License-Identifier: Apache-2.0
#include "clients/log/stamp_sorter.h"

#include <algorithm>
#include <utility>

namespace loci {

void StampSorter::Push(LogScan scan) {
  if (last_popped_ns_.has_value() && scan.stamp_ns < *last_popped_ns_) {
    ++late_count_;
    late_.push_back(std::move(scan));
    return;
  }
  newest_ns_ = std::max(newest_ns_.value_or(scan.stamp_ns), scan.stamp_ns);
  const auto position = std::upper_bound(
      waiting_.begin(), waiting_.end(), scan.stamp_ns, [](std::int64_t stamp_ns, const LogScan& b) {
        return stamp_ns < b.stamp_ns;
      });
  if (position != waiting_.end()) {
    ++moved_count_;
  }
  waiting_.insert(position, std::move(scan));
}

std::optional<LogScan> StampSorter::Pop() {
  std::optional<LogScan> scan;
  if (!late_.empty()) {
    scan = std::move(late_.front());
    late_.pop_front();
    return scan;
  }
  if (waiting_.empty() || (!finished_ && *newest_ns_ - waiting_.front().stamp_ns < window_ns_)) {
    return scan;
  }
  scan = std::move(waiting_.front());
  waiting_.pop_front();
  last_popped_ns_ = scan->stamp_ns;
  return scan;
}

}  // namespace loci
