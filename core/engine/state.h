// SPDX-License-Identifier: Apache-2.0
// All that an engine knows. Internal to core/engine.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/closure/place_match.h"
#include "core/engine/engine.h"
#include "core/engine/map_graph.h"
#include "core/mesh/mesh.h"
#include "core/place/place.h"
#include "core/place/track.h"

namespace loci {

// A finished place that is compared with older ones, one candidate at a time.
struct ClosureBatch {
  PlaceId place;
  std::vector<PlaceId> candidates;  // nearest first
  std::uint32_t next = 0;           // candidate that is looked at next
  std::vector<ClosureSnapshot> found;
};

// One run of one robot.
struct SessionState {
  std::string session;
  std::string robot;
  bool open = true;
  Pose2 map_from_start;
  std::uint64_t accepted_count = 0;
  std::uint64_t refused_count = 0;
  std::uint64_t last_number = 0;
  std::int64_t first_stamp_ns = 0;
  std::int64_t last_stamp_ns = 0;
  std::uint32_t place_count = 0;
  Track track;
  std::vector<ClosureBatch> batches;   // first in, first out
  std::vector<TrajectoryPose> newest;  // poses not yet in a full piece
  std::uint32_t piece_count = 0;

  // Full pieces; records of their own.
  std::vector<std::shared_ptr<const TrajectoryPiece>> pieces;
  std::vector<EventNumber> piece_changed_by;  // bookkeeping for checkpoints, not state
  EventNumber changed_by;                     // the same
};

// Poses in a full piece of a trajectory.
inline constexpr std::size_t kPiecePoses = 1024;

struct Engine::State {
  EventNumber last_event;
  MapSettings settings;
  std::uint64_t cells_integrated = 0;
  std::uint64_t cells_closed = 0;      // by optimising and moving the mesh: the promise is none
  std::vector<SessionState> sessions;  // by SessionId
  std::vector<Place> places;           // by PlaceId
  MapGraph graph;
  std::vector<ClosureSnapshot> closures;  // by ClosureId
  // Finished places that are to be looked at for consolidation; the last is the next.
  std::vector<PlaceId> consolidation_queue;
  std::optional<Mesh> mesh;  // from the map's creation on

  // Bookkeeping for checkpoints and snapshots, not state.
  EventNumber graph_changed_by;
  EventNumber graph_base_changed_by;
  std::uint64_t graph_base_count = 0;  // of the base that graph_base_changed_by speaks of
  EventNumber closures_changed_by;
  std::shared_ptr<const std::vector<ClosureSnapshot>> closures_snapshot;
  std::shared_ptr<const std::vector<ConstraintSnapshot>> constraints_snapshot;
};

// Seed of a random sequence: a hash of what it is for (design.md, section 3).
std::uint64_t SeedOf(const MapSettings& settings,
                     SessionId session,
                     std::uint64_t number,
                     std::uint64_t stage);

// The graph changed by the present event: caches of it are void.
void MarkGraphChanged(Engine::State& state);

// core/engine/closing.cc: looks for closures of a place that was just finished.
void BeginClosureBatch(PlaceId place, Engine::State& state);
// Compares up to `units` candidates of the session's batches, and optimises the graph where that
// gives closures; the effects say so. Once in an event.
void WorkOnClosures(SessionId session, std::uint32_t units, Engine::State& state, Effects& effects);

// core/engine/consolidating.cc: puts all finished places into the queue again.
void QueueConsolidation(Engine::State& state);
// Looks at up to `units` places of the queue and does as many steps of remeshing.
void WorkOnMesh(std::uint32_t units, Engine::State& state);
bool HasMeshWork(const Engine::State& state);

}  // namespace loci
