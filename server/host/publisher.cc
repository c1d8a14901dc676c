// SPDX-License-Identifier: Apache-2.0
#include "server/host/publisher.h"

#include <set>
#include <utility>
#include <vector>

#include "core/layer/layer.h"
#include "core/tile/tile_renderer.h"

namespace loci {
namespace {

bool IsSame(const SessionSnapshot& a, const SessionSnapshot& b) {
  return a.open == b.open && a.last_number == b.last_number &&
         a.map_from_robot == b.map_from_robot && a.map_from_odom == b.map_from_odom;
}

std::vector<SessionId> ChangedSessions(const Snapshot& before, const Snapshot& after) {
  std::vector<SessionId> changed;
  for (std::size_t i = 0; i < after.sessions.size(); ++i) {
    if (i >= before.sessions.size() || !IsSame(before.sessions[i], after.sessions[i])) {
      changed.push_back(after.sessions[i].id);
    }
  }
  return changed;
}

std::vector<TileAddress> DirtyTilesOfAllLayers(const Snapshot& before, const Snapshot& after) {
  std::set<TileAddress> dirty;
  for (const Layer layer : kLayers) {
    const std::vector<TileAddress> of_layer = DirtyTiles(before, after, layer);
    dirty.insert(of_layer.begin(), of_layer.end());
  }
  return {dirty.begin(), dirty.end()};
}

}  // namespace

class Publisher::Handle final : public Subscription {
 public:
  Handle(std::shared_ptr<Subscribers> subscribers, std::uint64_t id)
      : subscribers_(std::move(subscribers)), id_(id) {}
  ~Handle() override {
    const MutexLock lock(subscribers_->mutex);
    subscribers_->callbacks.erase(id_);
  }

 private:
  const std::shared_ptr<Subscribers> subscribers_;
  const std::uint64_t id_;
};

Publisher::Publisher(std::string map, const HostLimits& limits, const Clock& clock)
    : map_(std::move(map)), limits_(limits), ring_(limits, clock) {}

Publisher::~Publisher() = default;

void Publisher::Publish(std::shared_ptr<const Snapshot> snapshot, bool everything_moved) {
  const std::shared_ptr<const Snapshot> before = ring_.Peek();
  ring_.Publish(snapshot);
  const MutexLock lock(subscribers_->mutex);
  if (subscribers_->callbacks.empty()) {
    return;
  }
  RevisionChange change;
  change.map = map_;
  change.snapshot = snapshot;
  change.everything_moved = everything_moved || before == nullptr;
  if (before != nullptr) {
    change.sessions = ChangedSessions(*before, *snapshot);
  }
  if (!change.everything_moved) {
    change.dirty_tiles = DirtyTilesOfAllLayers(*before, *snapshot);
    if (change.dirty_tiles.size() > limits_.dirty_tiles_max) {
      change.everything_moved = true;
      change.dirty_tiles.clear();
    }
  }
  for (const auto& [id, callback] : subscribers_->callbacks) {
    callback(change);
  }
}

void Publisher::End() {
  RevisionChange change;
  change.map = map_;
  change.snapshot = ring_.Peek();
  change.ended = true;
  const MutexLock lock(subscribers_->mutex);
  if (change.snapshot != nullptr) {
    for (const auto& [id, callback] : subscribers_->callbacks) {
      callback(change);
    }
  }
  subscribers_->callbacks.clear();
}

std::unique_ptr<Subscription> Publisher::Subscribe(SnapshotSource::RevisionCallback callback) {
  const MutexLock lock(subscribers_->mutex);
  const std::uint64_t id = subscribers_->next_id++;
  subscribers_->callbacks.emplace(id, std::move(callback));
  return std::make_unique<Handle>(subscribers_, id);
}

}  // namespace loci
