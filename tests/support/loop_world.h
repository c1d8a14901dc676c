// SPDX-License-Identifier: Apache-2.0
// A robot that drives around a block and meets its own beginning again, as events of a map.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/engine/engine.h"
#include "tests/support/generator.h"

namespace loci {

// The events of a map and where the robot truly was at each observation.
struct SimulatedMap {
  std::vector<Event> events;
  std::vector<Pose2> map_from_robot;  // of observation number i + 1
};

inline MapSettings ShortPlaces() {
  MapSettings settings;
  settings.place_length_m = 3.0;
  return settings;
}

// Once around a block of 8 m and a little further, in about 340 observations: fourteen places and
// more, closures where the loop meets its beginning.
inline SimulatedMap DriveAroundTheBlock(std::uint64_t seed,
                                        const DriftOptions& drift = {.turn_rad_per_m = 0.01}) {
  const SimulatedWorld world = RingOfCorridors(8.0, 2.4, 3);
  const double lane = 5.2;
  SimulatedMap map;
  map.map_from_robot = DriveAlong(
      {{0.0, -lane}, {lane, -lane}, {lane, lane}, {-lane, lane}, {-lane, -lane}, {5.0, -lane}},
      0.16);
  map.events.emplace_back(CreateMapEvent{ShortPlaces()});
  map.events.emplace_back(OpenSessionEvent{"loop", "robot", map.map_from_robot[0]});
  for (Event& event :
       ObservationsAlong(world, map.map_from_robot, Scanner(), drift, SessionId{0}, seed)) {
    map.events.push_back(std::move(event));
  }
  map.events.emplace_back(CloseSessionEvent{SessionId{0}});
  return map;
}

inline Engine EngineOf(const std::vector<Event>& events) {
  Engine engine;
  for (const Event& event : events) {
    engine.Apply(event);
  }
  return engine;
}

// All that a reader can see in a snapshot.
inline Digest DigestOf(const Snapshot& snapshot) {
  HashArchive archive;
  archive(snapshot.revision, snapshot.settings, snapshot.cells_written);
  archive(snapshot.closures_accepted, snapshot.chi2);
  for (const SessionSnapshot& session : snapshot.sessions) {
    archive(session.id, session.session, session.robot, session.map_from_start, session.open);
    archive(session.accepted_count, session.refused_count, session.last_number);
    archive(session.first_stamp_ns, session.last_stamp_ns);
    archive(session.map_from_robot, session.map_from_odom);
    for (const auto& piece : session.trajectory) {
      archive(*piece);
    }
  }
  for (const PlaceSnapshot& place : snapshot.places) {
    archive(place.id, place.session, place.map_from_place, place.finished, place.consolidated);
  }
  for (const OverlaySnapshot& overlay : snapshot.overlays) {
    archive(overlay.place, overlay.stationary, overlay.moving);
  }
  for (const Eigen::Vector2d& vertex : snapshot.mesh->vertices_in_map) {
    archive(vertex.x(), vertex.y());
  }
  for (const LtrSnapshot& ltr : snapshot.mesh->ltrs) {
    archive(ltr.vertices, ltr.occupancy->cells, ltr.moving != nullptr);
    if (ltr.moving != nullptr) {
      archive(ltr.moving->cells);
    }
  }
  for (const ClosureSnapshot& closure : *snapshot.closures) {
    archive(closure.id, closure.from, closure.to, closure.state, closure.from_from_to);
    archive(closure.hausdorff_fraction, closure.correction_m, closure.chi2, closure.reason);
  }
  for (const ConstraintSnapshot& constraint : *snapshot.constraints) {
    archive(constraint.from, constraint.to, constraint.closure, constraint.from_from_to);
  }
  return archive.Finish();
}

// The robot's poses in the map, in order of arrival.
inline std::vector<Pose2> TrajectoryOf(const Snapshot& snapshot, SessionId session) {
  std::vector<Pose2> poses;
  for (const auto& piece : snapshot.sessions[session.value].trajectory) {
    for (const TrajectoryPose& pose : *piece) {
      poses.push_back(snapshot.places[pose.place.value].map_from_place * pose.place_from_robot);
    }
  }
  return poses;
}

}  // namespace loci
