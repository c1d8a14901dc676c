// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/log_player.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace loci::cli {

Status LogPlayer::Play(const std::function<void(const PlayerFigures&)>& on_scan) {
  while (true) {
    LOCI_ASSIGN_OR_RETURN(std::optional<LogScan> scan, reader_.Next());
    if (!scan.has_value()) {
      break;
    }
    sorter_.Push(std::move(*scan));
    LOCI_RETURN_IF_ERROR(SendReady(on_scan));
  }
  sorter_.Finish();
  return SendReady(on_scan);
}

Status LogPlayer::SendReady(const std::function<void(const PlayerFigures&)>& on_scan) {
  while (const std::optional<LogScan> scan = sorter_.Pop()) {
    v1::Observation observation = maker_.Make(*scan);
    ++number_;
    figures_.moved = sorter_.moved_count();
    figures_.late = sorter_.late_count();
    if (number_ < session_.next_number()) {
      ++figures_.passed_over;
      continue;
    }
    WaitForTurn(scan->stamp_ns);
    LOCI_RETURN_IF_ERROR(session_.Append(std::move(observation)));
    ++figures_.sent;
    on_scan(figures_);
  }
  return {};
}

void LogPlayer::WaitForTurn(std::int64_t stamp_ns) {
  if (!speed_.has_value()) {
    return;
  }
  const auto now = std::chrono::steady_clock::now();
  if (!first_sent_ns_.has_value()) {
    first_sent_ns_ = stamp_ns;
    begin_ = now;
  }
  const double due_ns = static_cast<double>(stamp_ns - *first_sent_ns_) / *speed_;
  std::this_thread::sleep_until(
      begin_ + std::chrono::nanoseconds(static_cast<std::int64_t>(std::max(due_ns, 0.0))));
}

}  // namespace loci::cli
