// SPDX-License-Identifier: Apache-2.0
// Encoded tiles that were asked for lately.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <tuple>

#include "core/engine/snapshot.h"
#include "core/layer/layer.h"
#include "core/tile/zoom.h"
#include "server/base/mutex.h"

namespace loci {

// PNGs by snapshot, layer and address: a snapshot never changes, so that nothing is ever out of
// date. It does not keep snapshots alive. Thread-safe.
class TileCache {
 public:
  // The bytes kept, bookkeeping included, stay below `size_max_bytes`; the least recently asked for
  // goes first.
  explicit TileCache(std::size_t size_max_bytes) : size_max_bytes_(size_max_bytes) {}

  // The tile's PNG, from the cache or rendered on this thread. `address` must be valid. Two threads
  // that ask for the same new tile both render it.
  std::shared_ptr<const std::string> FindOrRender(const std::shared_ptr<const Snapshot>& snapshot,
                                                  Layer layer,
                                                  const TileAddress& address) LOCI_EXCLUDES(mutex_);

 private:
  using Key = std::tuple<const Snapshot*, Layer, TileAddress>;
  struct Entry {
    Key key;
    std::weak_ptr<const Snapshot> snapshot;  // tells a new snapshot at an old address apart
    std::shared_ptr<const std::string> png;
  };
  using Entries = std::list<Entry>;  // the most recently asked for first

  static std::size_t SizeBytes(const Entry& entry);
  void Erase(Entries::iterator entry) LOCI_REQUIRES(mutex_);

  const std::size_t size_max_bytes_;
  Mutex mutex_;
  Entries entries_ LOCI_GUARDED_BY(mutex_);
  std::map<Key, Entries::iterator> by_key_ LOCI_GUARDED_BY(mutex_);
  std::size_t size_bytes_ LOCI_GUARDED_BY(mutex_) = 0;
};

}  // namespace loci
