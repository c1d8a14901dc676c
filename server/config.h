// SPDX-License-Identifier: Apache-2.0
// Every limit of the server: what it holds at most, and what happens then.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "server/base/clock.h"

namespace loci {

// Limits of one map.
struct HostLimits {
  // Bytes of requests of one session that wait to become durable; a further one is answered
  // RESOURCE_EXHAUSTED. One request is always let in, however large. Raise it for robots whose link
  // is long and fast.
  std::size_t session_window_bytes = std::size_t{4} << 20U;
  // The same for all sessions of a map together.
  std::size_t map_window_bytes = std::size_t{64} << 20U;

  // One append to the event log takes at most this much, so that the first of many waiting requests
  // is not answered after the last.
  std::size_t group_events_max = 1024;
  std::size_t group_bytes_max = std::size_t{4} << 20U;

  // Events that are durable but not applied. At the limit the appender waits, which fills the
  // windows above. It bounds how long a recovery and the closing of a session take. One append may
  // go beyond it.
  std::size_t unapplied_events_max = 2000;
  std::size_t unapplied_bytes_max = std::size_t{32} << 20U;

  // A revision is published when no event waits, but not more often than `min`; with events
  // waiting, after `max`.
  Duration publish_interval_min = std::chrono::milliseconds(20);
  Duration publish_interval_max = std::chrono::milliseconds(50);

  // Revisions that readers may pin. The last `snapshots_recent_max` are kept in any case. A
  // revision that an answer named is kept for `snapshot_kept` after it was last asked for, unless
  // `snapshots_answered_max` others were answered since; one that was asked for by its number only
  // competes with `snapshots_pinned_max` others of its kind. Afterwards the answer is NOT_FOUND.
  std::size_t snapshots_recent_max = 16;
  std::size_t snapshots_answered_max = 64;
  std::size_t snapshots_pinned_max = 32;
  Duration snapshot_kept = std::chrono::seconds(60);

  // A checkpoint is written after so many events or bytes of log. It bounds what a recovery
  // replays.
  std::uint64_t checkpoint_events = 2000;
  std::uint64_t checkpoint_log_bytes = std::uint64_t{16} << 20U;
  // After a checkpoint that could not be written, the next is tried no sooner than this.
  Duration checkpoint_retry = std::chrono::seconds(5);

  // A change that touches more tiles than this says "everything moved" instead of naming them.
  std::size_t dirty_tiles_max = 4096;
};

// Limits of the server as a whole.
struct ServerLimits {
  HostLimits host;
  // Every map has threads and an open file; creating one more is answered RESOURCE_EXHAUSTED.
  std::size_t maps_max = 1000;
  // Maps that are recovered at the same time after a start; the others wait.
  std::size_t recoveries_at_once = 2;
  // Encoded tiles kept, in bytes; the least recently asked for goes first.
  std::size_t tile_cache_bytes = std::size_t{32} << 20U;
  // Tiles of one StreamTiles call; more is OUT_OF_RANGE with the count.
  std::uint64_t stream_tiles_max = std::uint64_t{1} << 16U;
  // Cells of one StreamRaster call; more is OUT_OF_RANGE with the count. 2^32 is 3.2 x 3.2 km at
  // 0.05 m; rows are rendered in strips, so that memory does not follow it.
  std::uint64_t stream_raster_cells_max = std::uint64_t{1} << 32U;
  // Bytes of the bulk field of one message of a stream: under the 1 MiB that protocol.md names.
  std::size_t stream_chunk_bytes = 768U << 10U;
  // Poses per message of StreamTrajectory; one is below 140 bytes.
  std::size_t stream_poses = 4096;
  // Verifications that run at the same time; a further one is answered RESOURCE_EXHAUSTED.
  std::size_t verifications_at_once = 1;
};

}  // namespace loci
