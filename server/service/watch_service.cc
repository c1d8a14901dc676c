// SPDX-License-Identifier: Apache-2.0
#include "server/service/watch_service.h"

#include <memory>
#include <set>
#include <utility>

#include "loci/v1/watch.pb.h"
#include "server/base/mutex.h"
#include "server/convert/mapping_convert.h"

namespace loci {
namespace {

// What a watcher has not been told yet.
class PendingChange {
 public:
  // The newest state as the first message: a watcher that begins knows nothing.
  PendingChange(std::size_t tiles_max, std::shared_ptr<const Snapshot> newest)
      : tiles_max_(tiles_max), newest_(std::move(newest)), everything_moved_(true) {
    for (const SessionSnapshot& session : newest_->sessions) {
      sessions_.insert(session.id);
    }
  }

  void Merge(const RevisionChange& change) LOCI_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    ended_ = ended_ || change.ended;
    if (change.snapshot->revision <= newest_->revision) {
      return;
    }
    newest_ = change.snapshot;
    waiting_ = true;
    everything_moved_ = everything_moved_ || change.everything_moved;
    sessions_.insert(change.sessions.begin(), change.sessions.end());
    tiles_.insert(change.dirty_tiles.begin(), change.dirty_tiles.end());
    if (everything_moved_ || tiles_.size() > tiles_max_) {
      everything_moved_ = true;
      tiles_.clear();
    }
  }

  StatusOr<StreamStep> Take(v1::MapChange& message) LOCI_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    if (!waiting_) {
      if (ended_) {
        return UnavailableError("the map was deleted, or the server stops");
      }
      return StreamStep::kWait;
    }
    message.set_revision(newest_->revision.value);
    message.set_everything_moved(everything_moved_);
    message.set_closures(newest_->closures_accepted);
    for (const TileAddress& address : tiles_) {
      v1::TileAddress& tile = *message.add_dirty_tiles();
      tile.set_zoom(static_cast<std::uint32_t>(address.zoom));
      tile.set_x(address.x);
      tile.set_y(address.y);
    }
    for (const SessionId session : sessions_) {
      Fill(newest_->sessions[session.value], newest_->revision, *message.add_sessions());
    }
    waiting_ = false;
    everything_moved_ = false;
    tiles_.clear();
    sessions_.clear();
    return StreamStep::kMessage;
  }

 private:
  const std::size_t tiles_max_;
  Mutex mutex_;
  std::shared_ptr<const Snapshot> newest_ LOCI_GUARDED_BY(mutex_);
  bool waiting_ LOCI_GUARDED_BY(mutex_) = true;
  bool ended_ LOCI_GUARDED_BY(mutex_) = false;
  bool everything_moved_ LOCI_GUARDED_BY(mutex_);
  std::set<TileAddress> tiles_ LOCI_GUARDED_BY(mutex_);
  std::set<SessionId> sessions_ LOCI_GUARDED_BY(mutex_);
};

}  // namespace

void WatchService::AddTo(Dispatcher& dispatcher) {
  dispatcher.AddService("loci.v1.Watch");
  dispatcher.AddServerStream<v1::WatchMapRequest, v1::MapChange>(
      "loci.v1.Watch/WatchMap",
      Execution::kWorker,
      [this](const std::shared_ptr<ServerCall>& call,
             const v1::WatchMapRequest& request) -> StatusOr<StreamSource<v1::MapChange>> {
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<const Snapshot> newest,
                              maps_.FindSnapshot(request.map(), Revision{}));
        const auto pending = std::make_shared<PendingChange>(limits_.host.dirty_tiles_max, newest);
        // Weak: the call owns the source, which owns the subscription, which must not own the call.
        const auto tell =
            [pending, weak_call = std::weak_ptr<ServerCall>(call)](const RevisionChange& change) {
              pending->Merge(change);
              if (const std::shared_ptr<ServerCall> alive = weak_call.lock(); alive != nullptr) {
                alive->Wake();
              }
            };
        LOCI_ASSIGN_OR_RETURN(std::unique_ptr<Subscription> subscription,
                              maps_.Subscribe(request.map(), tell));
        // What was published between the two calls above.
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<const Snapshot> since,
                              maps_.FindSnapshot(request.map(), Revision{}));
        RevisionChange missed;
        missed.map = request.map();
        missed.snapshot = since;
        missed.everything_moved = true;
        pending->Merge(missed);
        return StreamSource<v1::MapChange>(
            [pending, subscription = std::shared_ptr<Subscription>(std::move(subscription))](
                v1::MapChange& message) { return pending->Take(message); });
      });
}

}  // namespace loci
