// SPDX-License-Identifier: Apache-2.0
// The state as readers see it.
#include <memory>

#include "core/engine/state.h"

namespace loci {
namespace {

SessionSnapshot SnapshotOf(std::size_t index, const Engine::State& state) {
  const SessionState& session = state.sessions[index];
  SessionSnapshot snapshot;
  snapshot.id = SessionId{static_cast<std::uint32_t>(index)};
  snapshot.session = session.session;
  snapshot.robot = session.robot;
  snapshot.open = session.open;
  snapshot.map_from_start = session.map_from_start;
  snapshot.accepted_count = session.accepted_count;
  snapshot.refused_count = session.refused_count;
  snapshot.last_number = session.last_number;
  snapshot.first_stamp_ns = session.first_stamp_ns;
  snapshot.last_stamp_ns = session.last_stamp_ns;
  snapshot.map_from_robot =
      state.graph.map_from_place(session.track.place) * session.track.place_from_robot;
  snapshot.map_from_odom = snapshot.map_from_robot * Inverse(session.track.odom_from_robot);
  snapshot.trajectory = session.pieces;
  if (!session.newest.empty()) {
    snapshot.trajectory.push_back(std::make_shared<const TrajectoryPiece>(session.newest));
  }
  return snapshot;
}

std::shared_ptr<const std::vector<ConstraintSnapshot>> ConstraintsOf(const Engine::State& state) {
  auto constraints = std::make_shared<std::vector<ConstraintSnapshot>>();
  const PoseGraph& graph = state.graph.graph();
  constraints->reserve(graph.constraints.size());
  for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
    const GraphConstraint& constraint = graph.constraints[i];
    constraints->push_back({PlaceId{constraint.from},
                            PlaceId{constraint.to},
                            state.graph.closures()[i].has_value(),
                            constraint.from_from_to,
                            constraint.information});
  }
  return constraints;
}

}  // namespace

std::shared_ptr<const Snapshot> Engine::TakeSnapshot() {
  State& state = *state_;
  auto snapshot = std::make_shared<Snapshot>();
  snapshot->revision = state.last_event;
  snapshot->settings = state.settings;
  for (std::size_t i = 0; i < state.sessions.size(); ++i) {
    snapshot->sessions.push_back(SnapshotOf(i, state));
  }
  for (Place& place : state.places) {
    snapshot->places.push_back({place.id,
                                place.session,
                                state.graph.map_from_place(place.id),
                                place.finished,
                                place.consolidated});
    if (!place.consolidated) {
      snapshot->overlays.push_back({place.id, place.stationary.Share(), place.moving.Share()});
    }
  }
  snapshot->mesh =
      state.mesh.has_value() ? state.mesh->TakeSnapshot() : std::make_shared<const MeshSnapshot>();
  if (state.closures_snapshot == nullptr) {
    state.closures_snapshot = std::make_shared<const std::vector<ClosureSnapshot>>(state.closures);
  }
  snapshot->closures = state.closures_snapshot;
  if (state.constraints_snapshot == nullptr) {
    state.constraints_snapshot = ConstraintsOf(state);
  }
  snapshot->constraints = state.constraints_snapshot;
  snapshot->cells_written.integrate = state.cells_integrated;
  snapshot->cells_written.closure = state.cells_closed;
  if (state.mesh.has_value()) {
    snapshot->cells_written.consolidate = state.mesh->cells_consolidated();
    snapshot->cells_written.remesh = state.mesh->cells_remeshed();
  }
  snapshot->closures_accepted = static_cast<std::uint32_t>(state.graph.closure_count());
  snapshot->chi2 = state.graph.chi2();
  return snapshot;
}

}  // namespace loci
