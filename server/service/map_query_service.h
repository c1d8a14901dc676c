// SPDX-License-Identifier: Apache-2.0
// What map clients ask (loci.v1.MapQuery).
#pragma once

#include "server/config.h"
#include "server/rpc/dispatcher.h"
#include "server/service/tile_cache.h"
#include "server/snapshot_source.h"

namespace loci {

// Every answer, and every stream as a whole, is of one snapshot; no call waits for a writer.
// Thread-safe.
class MapQueryService {
 public:
  // References must outlive the service. Destroy it after Dispatcher::Stop.
  MapQueryService(const ServerLimits& limits, const SnapshotSource& maps, TileCache& tiles)
      : limits_(limits), maps_(maps), tiles_(tiles) {}

  void AddTo(Dispatcher& dispatcher);

 private:
  void AddTiles(Dispatcher& dispatcher);
  void AddRaster(Dispatcher& dispatcher);
  void AddTrajectory(Dispatcher& dispatcher);
  void AddShapes(Dispatcher& dispatcher);

  const ServerLimits limits_;
  const SnapshotSource& maps_;
  TileCache& tiles_;
};

}  // namespace loci
