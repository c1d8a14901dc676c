// SPDX-License-Identifier: Apache-2.0
#include "server/service/tile_cache.h"

#include <utility>

#include "core/tile/tile_renderer.h"
#include "server/tile/png_encoder.h"

namespace loci {

std::shared_ptr<const std::string> TileCache::FindOrRender(
    const std::shared_ptr<const Snapshot>& snapshot, Layer layer, const TileAddress& address) {
  const Key key{snapshot.get(), layer, address};
  {
    const MutexLock lock(mutex_);
    if (const auto found = by_key_.find(key); found != by_key_.end()) {
      if (found->second->snapshot.lock() == snapshot) {
        entries_.splice(entries_.begin(), entries_, found->second);
        return found->second->png;
      }
      Erase(found->second);
    }
  }
  const TileImage image = RenderTile(*snapshot, layer, address);
  auto png = std::make_shared<const std::string>(EncodePng(image, layer, PngStyle::kFull));
  const MutexLock lock(mutex_);
  if (by_key_.contains(key)) {
    return png;  // another thread was faster
  }
  entries_.push_front({key, snapshot, png});
  by_key_.emplace(key, entries_.begin());
  size_bytes_ += SizeBytes(entries_.front());
  while (size_bytes_ > size_max_bytes_ && !entries_.empty()) {
    Erase(std::prev(entries_.end()));
  }
  return png;
}

std::size_t TileCache::SizeBytes(const Entry& entry) {
  // Nodes of list and map, and the string's own block.
  constexpr std::size_t kBookkeepingBytes = 256;
  return sizeof(Entry) + entry.png->capacity() + kBookkeepingBytes;
}

void TileCache::Erase(Entries::iterator entry) {
  size_bytes_ -= SizeBytes(*entry);
  by_key_.erase(entry->key);
  entries_.erase(entry);
}

}  // namespace loci
