// SPDX-License-Identifier: Apache-2.0
#include "server/http/revision_events.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <utility>

#include "core/tile/zoom.h"
#include "server/base/mutex.h"

namespace loci {
namespace {

// With more dirty tiles than this it is shorter, and no more work for a viewer, to fetch all again.
constexpr std::size_t kDirtyTilesMax = 4096;

class RevisionEvents final : public HttpEventSource {
 public:
  explicit RevisionEvents(std::function<void()> wake) : wake_(std::move(wake)) {}

  Status Open(SnapshotSource& maps, const std::string& map) {
    StatusOr<std::unique_ptr<Subscription>> subscription =
        maps.Subscribe(map, [this](const RevisionChange& change) { OnChange(change); });
    LOCI_RETURN_IF_ERROR(subscription.status());
    subscription_ = std::move(subscription).value();
    const StatusOr<std::shared_ptr<const Snapshot>> newest = maps.FindSnapshot(map, Revision());
    LOCI_RETURN_IF_ERROR(newest.status());
    const MutexLock lock(mutex_);
    revision_ = std::max(revision_, (*newest)->revision);
    everything_moved_ = true;
    pending_ = true;
    return Status();
  }

  std::string Take() override {
    const MutexLock lock(mutex_);
    if (ended_) {
      return std::exchange(end_said_, true) ? "" : "event: ended\ndata: {}\n\n";
    }
    if (!pending_) {
      return "";
    }
    const std::string number = std::to_string(revision_.value);
    std::string text = "id: " + number + "\nevent: revision\ndata: {\"dirty_tiles\":[";
    const char* separator = "";
    for (const auto& [x, y] : dirty_tiles_) {
      text += separator;
      text += '[' + std::to_string(x) + ',' + std::to_string(y) + ']';
      separator = ",";
    }
    text += std::string("],\"everything_moved\":") + (everything_moved_ ? "true" : "false") +
            ",\"revision\":" + number + ",\"tile_zoom\":" + std::to_string(kDirtyTileZoom) +
            "}\n\n";
    dirty_tiles_.clear();
    everything_moved_ = false;
    pending_ = false;
    return text;
  }

 private:
  // On the thread that applies events.
  void OnChange(const RevisionChange& change) LOCI_EXCLUDES(mutex_) {
    {
      const MutexLock lock(mutex_);
      pending_ = true;
      ended_ = ended_ || change.ended;
      if (change.snapshot) {
        revision_ = std::max(revision_, change.snapshot->revision);
      }
      everything_moved_ = everything_moved_ || change.everything_moved ||
                          dirty_tiles_.size() + change.dirty_tiles.size() > kDirtyTilesMax;
      if (everything_moved_) {
        dirty_tiles_.clear();
      } else {
        for (const TileAddress& tile : change.dirty_tiles) {
          dirty_tiles_.emplace(tile.x, tile.y);
        }
      }
    }
    wake_();
  }

  const std::function<void()> wake_;
  Mutex mutex_;
  Revision revision_ LOCI_GUARDED_BY(mutex_);
  std::set<std::pair<std::int32_t, std::int32_t>> dirty_tiles_ LOCI_GUARDED_BY(mutex_);
  bool everything_moved_ LOCI_GUARDED_BY(mutex_) = false;
  bool pending_ LOCI_GUARDED_BY(mutex_) = false;
  bool ended_ LOCI_GUARDED_BY(mutex_) = false;
  bool end_said_ LOCI_GUARDED_BY(mutex_) = false;
  std::unique_ptr<Subscription> subscription_;  // last: it ends before what its callback uses
};

}  // namespace

StatusOr<std::unique_ptr<HttpEventSource>> OpenRevisionEvents(SnapshotSource& maps,
                                                              const std::string& map,
                                                              std::function<void()> wake) {
  auto events = std::make_unique<RevisionEvents>(std::move(wake));
  LOCI_RETURN_IF_ERROR(events->Open(maps, map));
  return std::unique_ptr<HttpEventSource>(std::move(events));
}

}  // namespace loci
