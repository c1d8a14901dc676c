// SPDX-License-Identifier: Apache-2.0
// The published revisions of a map that readers may still ask for.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "core/engine/snapshot.h"
#include "server/base/clock.h"
#include "server/base/mutex.h"
#include "server/config.h"

namespace loci {

// Keeps the newest snapshot, the last few, and those that readers asked for, within HostLimits.
// Snapshots share what did not change, so that a kept one costs what changed since. Thread-safe.
class SnapshotRing {
 public:
  // `clock` must outlive the ring.
  SnapshotRing(const HostLimits& limits, const Clock& clock) : limits_(limits), clock_(clock) {}

  // Revisions must grow from call to call.
  void Publish(std::shared_ptr<const Snapshot> snapshot);

  // The newest; null before the first Publish. Reading it keeps its revision for pinning.
  std::shared_ptr<const Snapshot> Newest() const;
  // The newest, for answers that name no revision.
  std::shared_ptr<const Snapshot> Peek() const;

  // kNotFound if `revision` was never published or is not kept any more.
  StatusOr<std::shared_ptr<const Snapshot>> Find(Revision revision) const;

 private:
  enum class Use : std::uint8_t { kNone, kAnswered, kPinned };
  struct Entry {
    std::shared_ptr<const Snapshot> snapshot;
    Use use = Use::kNone;
    TimePoint last_used;
  };

  void Evict() LOCI_REQUIRES(mutex_);
  void EvictLeastRecentlyUsed(Use use, std::size_t count_max) LOCI_REQUIRES(mutex_);

  const HostLimits limits_;
  const Clock& clock_;
  mutable Mutex mutex_;
  // In order of revision, the newest last. Mutable: reading notes what was read.
  mutable std::deque<Entry> entries_ LOCI_GUARDED_BY(mutex_);
};

}  // namespace loci
