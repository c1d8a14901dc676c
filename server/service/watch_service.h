// SPDX-License-Identifier: Apache-2.0
// The change feed of a map (loci.v1.Watch).
#pragma once

#include "server/config.h"
#include "server/rpc/dispatcher.h"
#include "server/snapshot_source.h"

namespace loci {

// One subscription per call. What a slow reader misses is merged into the next message, so that a
// watcher costs a bounded amount of memory. Thread-safe.
class WatchService {
 public:
  // `maps` must outlive the service. Destroy it after Dispatcher::Stop.
  WatchService(const ServerLimits& limits, SnapshotSource& maps) : limits_(limits), maps_(maps) {}

  void AddTo(Dispatcher& dispatcher);

 private:
  const ServerLimits limits_;
  SnapshotSource& maps_;
};

}  // namespace loci
