// SPDX-License-Identifier: Apache-2.0
// What readers ask of the server's maps: snapshots by revision, states, and news of revisions.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "core/engine/snapshot.h"
#include "core/tile/zoom.h"

namespace loci {

enum class MapState : std::uint8_t {
  kRecovering,  // the log is being replayed; calls get kUnavailable
  kServing,
  kRefused,  // damaged, or its disk failed; `problem` says what and what to do
};

// The events that accepted loop closures since the map was opened.
struct ClosureTimes {
  std::uint64_t events = 0;
  double last_ms = 0.0;  // wall time, from the event to the state after it
  double max_ms = 0.0;
  double total_ms = 0.0;
  std::uint64_t last_places_moved = 0;  // by more than a millimetre or a milliradian
};

// One map, for lists and for metrics.
struct MapStatus {
  std::string map;
  MapState state = MapState::kRecovering;
  std::string problem;  // why it is refused, or takes no writes; empty if all is well
  std::shared_ptr<const Snapshot> newest;  // null unless kServing
  std::uint64_t last_event = 0;            // last durable event
  std::uint64_t last_checkpoint = 0;       // event of the newest checkpoint; 0: none
  std::uint64_t recovered_from = 0;        // event of the checkpoint that it began with; 0: none
  std::uint64_t events_replayed = 0;       // after it, when the map was opened
  std::uint64_t events_waiting = 0;        // durable, not yet applied
  std::uint64_t bytes_waiting = 0;         // of requests that are not yet durable
  std::uint64_t appends = 0;               // transactions of the log since the map was opened
  std::uint64_t append_failures = 0;
  ClosureTimes closures;
  std::uint64_t digests = 0;  // times that the whole state was hashed since the map was opened
};

// One published revision and how it differs from the one published before it.
struct RevisionChange {
  std::string map;
  std::shared_ptr<const Snapshot> snapshot;  // never null
  bool everything_moved = false;             // a closure was accepted; dirty_tiles is then empty
  std::vector<TileAddress> dirty_tiles;      // at kDirtyTileZoom, each once; their parents and
                                             // children are dirty too
  std::vector<SessionId> sessions;           // those that changed, in order
  bool ended = false;  // the last call: the map was deleted, or the server stops
};

// Keeps a callback subscribed. After its destructor returned, the callback does not run any more:
// it waits for one that runs, so whoever destroys it must not hold what the callback needs. The
// callback itself may destroy it, and then is the last.
class Subscription {
 public:
  Subscription() = default;
  Subscription(const Subscription&) = delete;
  Subscription& operator=(const Subscription&) = delete;
  virtual ~Subscription() = default;
};

// The maps of a server, for those who only read. Thread-safe; no call waits for a writer.
class SnapshotSource {
 public:
  virtual ~SnapshotSource() = default;

  // The state of `map` at `revision`; a default one asks for the newest.
  // Errors: kNotFound (no such map; or a revision that never was published or is not kept any
  // more), kUnavailable (the map is recovering), kDataLoss (the map is refused).
  virtual StatusOr<std::shared_ptr<const Snapshot>> FindSnapshot(const std::string& map,
                                                                 Revision revision) const = 0;

  // All maps in order of name.
  virtual std::vector<MapStatus> Maps() const = 0;

  // Calls `callback` for each revision published from now on, in order, on the thread that applies
  // events: it must be quick and must not call back into this object. Errors as FindSnapshot.
  using RevisionCallback = std::function<void(const RevisionChange&)>;
  virtual StatusOr<std::unique_ptr<Subscription>> Subscribe(const std::string& map,
                                                            RevisionCallback callback) = 0;
};

}  // namespace loci
