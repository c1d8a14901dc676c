// SPDX-License-Identifier: Apache-2.0
#include "server/host/publisher.h"

#include <set>
#include <thread>
#include <utility>

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

// One subscription's callback. It runs without any lock of the publisher's: whatever it lets go may
// end a subscription, its own included.
class Publisher::Subscriber {
 public:
  explicit Subscriber(SnapshotSource::RevisionCallback callback) : callback_(std::move(callback)) {}

  // Unless it has ended. By one thread at a time.
  void Tell(const RevisionChange& change) LOCI_EXCLUDES(mutex_) {
    {
      const MutexLock lock(mutex_);
      if (ended_) {
        return;
      }
      running_on_ = std::this_thread::get_id();
    }
    callback_(change);
    const MutexLock lock(mutex_);
    running_on_ = std::thread::id();
    idle_.NotifyAll();
  }

  // Afterwards the callback is not called any more. Waits for the end of one that runs, unless it
  // is that one that calls.
  void End() LOCI_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    ended_ = true;
    while (running_on_ != std::thread::id() && running_on_ != std::this_thread::get_id()) {
      idle_.Wait(mutex_);
    }
  }

 private:
  const SnapshotSource::RevisionCallback callback_;
  Mutex mutex_;
  ConditionVariable idle_;
  std::thread::id running_on_ LOCI_GUARDED_BY(mutex_);  // of no thread: it does not run
  bool ended_ LOCI_GUARDED_BY(mutex_) = false;
};

class Publisher::Handle final : public Subscription {
 public:
  Handle(std::shared_ptr<Subscribers> subscribers,
         std::uint64_t id,
         std::shared_ptr<Subscriber> subscriber)
      : subscribers_(std::move(subscribers)), id_(id), subscriber_(std::move(subscriber)) {}
  ~Handle() override {
    {
      const MutexLock lock(subscribers_->mutex);
      subscribers_->by_id.erase(id_);
    }
    subscriber_->End();
  }

 private:
  const std::shared_ptr<Subscribers> subscribers_;
  const std::uint64_t id_;
  const std::shared_ptr<Subscriber> subscriber_;
};

Publisher::Publisher(std::string map, const HostLimits& limits, const Clock& clock)
    : map_(std::move(map)), limits_(limits), ring_(limits, clock) {}

Publisher::~Publisher() = default;

void Publisher::Publish(const std::shared_ptr<const Snapshot>& snapshot, bool everything_moved) {
  const std::shared_ptr<const Snapshot> before = ring_.Peek();
  ring_.Publish(snapshot);
  const std::vector<std::shared_ptr<Subscriber>> subscribers = CurrentSubscribers();
  if (subscribers.empty()) {
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
  for (const std::shared_ptr<Subscriber>& subscriber : subscribers) {
    subscriber->Tell(change);
  }
}

void Publisher::End() {
  RevisionChange change;
  change.map = map_;
  change.snapshot = ring_.Peek();
  change.ended = true;
  if (change.snapshot != nullptr) {
    for (const std::shared_ptr<Subscriber>& subscriber : CurrentSubscribers()) {
      subscriber->Tell(change);
    }
  }
  std::map<std::uint64_t, std::shared_ptr<Subscriber>> forgotten;
  const MutexLock lock(subscribers_->mutex);
  forgotten.swap(subscribers_->by_id);
}

std::unique_ptr<Subscription> Publisher::Subscribe(SnapshotSource::RevisionCallback callback) {
  const auto subscriber = std::make_shared<Subscriber>(std::move(callback));
  const MutexLock lock(subscribers_->mutex);
  const std::uint64_t id = subscribers_->next_id++;
  subscribers_->by_id.emplace(id, subscriber);
  return std::make_unique<Handle>(subscribers_, id, subscriber);
}

std::vector<std::shared_ptr<Publisher::Subscriber>> Publisher::CurrentSubscribers() const {
  const MutexLock lock(subscribers_->mutex);
  std::vector<std::shared_ptr<Subscriber>> current;
  for (const auto& [id, subscriber] : subscribers_->by_id) {
    current.push_back(subscriber);
  }
  return current;
}

}  // namespace loci
