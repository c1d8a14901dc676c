// SPDX-License-Identifier: Apache-2.0
#include "server/host/snapshot_ring.h"

#include <algorithm>
#include <string>
#include <utility>

namespace loci {

void SnapshotRing::Publish(std::shared_ptr<const Snapshot> snapshot) {
  const MutexLock lock(mutex_);
  LOCI_CHECK(entries_.empty() || entries_.back().snapshot->revision < snapshot->revision);
  entries_.push_back({std::move(snapshot), Use::kNone, clock_.Now()});
  Evict();
}

std::shared_ptr<const Snapshot> SnapshotRing::Newest() const {
  const MutexLock lock(mutex_);
  if (entries_.empty()) {
    return nullptr;
  }
  Entry& newest = entries_.back();
  newest.use = std::max(newest.use, Use::kAnswered);
  newest.last_used = clock_.Now();
  return newest.snapshot;
}

std::shared_ptr<const Snapshot> SnapshotRing::Peek() const {
  const MutexLock lock(mutex_);
  return entries_.empty() ? nullptr : entries_.back().snapshot;
}

StatusOr<std::shared_ptr<const Snapshot>> SnapshotRing::Find(Revision revision) const {
  const MutexLock lock(mutex_);
  const auto found = std::lower_bound(
      entries_.begin(), entries_.end(), revision, [](const Entry& entry, Revision wanted) {
        return entry.snapshot->revision < wanted;
      });
  if (found == entries_.end() || found->snapshot->revision != revision) {
    return NotFoundError(
        "revision: " + std::to_string(revision.value) +
        " is not kept; ask without a revision and go on with the one in the answer");
  }
  found->use = Use::kPinned;
  found->last_used = clock_.Now();
  return found->snapshot;
}

void SnapshotRing::Evict() {
  const TimePoint now = clock_.Now();
  const std::size_t recent = std::min(entries_.size(), limits_.snapshots_recent_max);
  const auto first_recent =
      entries_.end() - static_cast<std::ptrdiff_t>(std::max<std::size_t>(recent, 1));
  const auto kept_end = std::remove_if(entries_.begin(), first_recent, [&](const Entry& entry) {
    return entry.use == Use::kNone || now - entry.last_used > limits_.snapshot_kept;
  });
  entries_.erase(kept_end, first_recent);
  EvictLeastRecentlyUsed(Use::kAnswered, limits_.snapshots_answered_max);
  EvictLeastRecentlyUsed(Use::kPinned, limits_.snapshots_pinned_max);
}

void SnapshotRing::EvictLeastRecentlyUsed(Use use, std::size_t count_max) {
  const auto is_of_use = [use](const Entry& entry) { return entry.use == use; };
  auto count = static_cast<std::size_t>(std::count_if(entries_.begin(), entries_.end(), is_of_use));
  for (; count > count_max; --count) {
    auto oldest = entries_.end();
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (is_of_use(*entry) && (oldest == entries_.end() || entry->last_used < oldest->last_used)) {
        oldest = entry;
      }
    }
    if (std::next(oldest) == entries_.end()) {
      return;  // the newest stays whatever its use
    }
    entries_.erase(oldest);
  }
}

}  // namespace loci
