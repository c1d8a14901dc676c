// SPDX-License-Identifier: Apache-2.0
// Publishes a map's revisions: keeps them for readers and tells those who watch.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/base/clock.h"
#include "server/base/mutex.h"
#include "server/config.h"
#include "server/host/snapshot_ring.h"
#include "server/snapshot_source.h"

namespace loci {

// One map's published states. Publish and End are the applier's; the rest is thread-safe.
class Publisher {
 public:
  // `clock` must outlive the publisher.
  Publisher(std::string map, const HostLimits& limits, const Clock& clock);
  ~Publisher();

  // Makes `snapshot` the newest and calls every subscriber. `everything_moved`: a closure was
  // accepted since the last call.
  void Publish(const std::shared_ptr<const Snapshot>& snapshot, bool everything_moved);

  // Calls every subscriber a last time and forgets them.
  void End();

  const SnapshotRing& ring() const { return ring_; }

  // See SnapshotSource. The subscription may outlive the publisher.
  std::unique_ptr<Subscription> Subscribe(SnapshotSource::RevisionCallback callback);

 private:
  class Subscriber;
  class Handle;
  // Shared with the subscriptions, which remove themselves.
  struct Subscribers {
    Mutex mutex;
    std::uint64_t next_id LOCI_GUARDED_BY(mutex) = 0;
    std::map<std::uint64_t, std::shared_ptr<Subscriber>> by_id LOCI_GUARDED_BY(mutex);
  };

  std::vector<std::shared_ptr<Subscriber>> CurrentSubscribers() const;

  const std::string map_;
  const HostLimits limits_;
  SnapshotRing ring_;
  const std::shared_ptr<Subscribers> subscribers_ = std::make_shared<Subscribers>();
};

}  // namespace loci
