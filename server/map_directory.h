// SPDX-License-Identifier: Apache-2.0
// All maps of a data directory.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/engine/settings.h"
#include "server/base/clock.h"
#include "server/base/mutex.h"
#include "server/config.h"
#include "server/map_host.h"
#include "server/snapshot_source.h"
#include "storage/store.h"

namespace loci {

// Opens, makes and deletes maps; a damaged one is listed with its problem, and the others are
// served. Thread-safe.
class MapDirectory final : public SnapshotSource {
 public:
  // Begins to recover every map of `store`; returns at once. `clock` must outlive the directory.
  // Errors: those of StoreDirectory::List.
  static StatusOr<std::unique_ptr<MapDirectory>> Open(std::unique_ptr<StoreDirectory> store,
                                                      const ServerLimits& limits,
                                                      const Clock& clock);
  // Stops every map with kAbandon if Stop was not called.
  ~MapDirectory() override;

  // Makes a map and waits until it is served. Errors: kInvalidArgument (name, settings),
  // kAlreadyExists, kResourceExhausted (disk full; too many maps).
  Status Create(const std::string& map, const MapSettings& settings) LOCI_EXCLUDES(mutex_);
  // Stops the map and removes its file, also of a damaged one. kNotFound.
  Status Delete(const std::string& map) LOCI_EXCLUDES(mutex_);
  // kNotFound; kInvalidArgument for what cannot be a name.
  StatusOr<std::shared_ptr<MapHost>> Find(const std::string& map) const LOCI_EXCLUDES(mutex_);

  StatusOr<std::shared_ptr<const Snapshot>> FindSnapshot(const std::string& map,
                                                         Revision revision) const override;
  std::vector<MapStatus> Maps() const override LOCI_EXCLUDES(mutex_);
  StatusOr<std::unique_ptr<Subscription>> Subscribe(const std::string& map,
                                                    RevisionCallback callback) override;

  // Stops every map, all at the same time. Calls get kUnavailable afterwards.
  void Stop(StopMode mode) LOCI_EXCLUDES(mutex_);

 private:
  MapDirectory(std::unique_ptr<StoreDirectory> store,
               const ServerLimits& limits,
               const Clock& clock);

  std::shared_ptr<MapHost> StartHost(const std::string& map);
  Status MakeStore(const std::string& map, const MapSettings& settings);

  const std::unique_ptr<StoreDirectory> store_;
  const ServerLimits limits_;
  const Clock& clock_;
  RecoveryGate gate_;

  mutable Mutex mutex_;
  // Null while the map is made or deleted: its name is taken, and nobody finds it.
  std::map<std::string, std::shared_ptr<MapHost>> hosts_ LOCI_GUARDED_BY(mutex_);
  bool stopped_ LOCI_GUARDED_BY(mutex_) = false;
};

}  // namespace loci
