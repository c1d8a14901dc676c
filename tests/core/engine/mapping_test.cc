// SPDX-License-Identifier: Apache-2.0
// What the engine makes of a drive: closures, consolidation, trajectories, accuracy.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "core/engine/engine.h"
#include "core/engine/event.h"
#include "tests/support/loop_world.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

double MeanErrorM(const std::vector<Pose2>& estimated, const std::vector<Pose2>& truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < estimated.size(); ++i) {
    sum += (estimated[i].translation() - truth[i].translation()).norm();
  }
  return sum / static_cast<double>(estimated.size());
}

TEST(MappingTest, ALoopClosesAndItsErrorFalls) {
  const SimulatedMap loop = DriveAroundTheBlock(2);
  Engine engine = EngineOf(loop.events);
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  EXPECT_FALSE(snapshot->closures->empty());
  EXPECT_GE(snapshot->closures_accepted, 1U);
  const std::vector<Pose2> trajectory = TrajectoryOf(*snapshot, SessionId{0});
  ASSERT_EQ(trajectory.size(), loop.map_from_robot.size());
  EXPECT_LT(MeanErrorM(trajectory, loop.map_from_robot), 0.06);
  for (const ClosureSnapshot& closure : *snapshot->closures) {
    EXPECT_EQ(closure.reason.empty(), closure.state == ClosureState::kAccepted);
  }
}

TEST(MappingTest, EveryScanHasAPoseOfItsStampAndTheCurrentPoseIsTheLast) {
  const SimulatedMap loop = DriveAroundTheBlock(3);
  Engine engine = EngineOf(loop.events);
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  const SessionSnapshot& session = snapshot->sessions[0];
  EXPECT_EQ(session.accepted_count, loop.map_from_robot.size());
  std::size_t index = 0;
  for (const auto& piece : session.trajectory) {
    for (const TrajectoryPose& pose : *piece) {
      EXPECT_EQ(pose.stamp_ns, std::get<ObservationEvent>(loop.events[index + 2]).stamp_ns);
      ++index;
    }
  }
  EXPECT_EQ(index, loop.map_from_robot.size());
  const Pose2 last = TrajectoryOf(*snapshot, SessionId{0}).back();
  EXPECT_LT((Inverse(last) * session.map_from_robot).translation().norm(), 1e-9);
  EXPECT_FALSE(session.open);
}

// The textures of a mesh by their corners.
using Corners = std::array<VertexId, 3>;
std::map<Corners, const LtrSnapshot*> LtrsByCorners(const MeshSnapshot& mesh) {
  std::map<Corners, const LtrSnapshot*> ltrs;
  for (const LtrSnapshot& ltr : mesh.ltrs) {
    ltrs[ltr.vertices] = &ltr;
  }
  return ltrs;
}

// Expects that `after` is `before` with its vertices elsewhere: the same triangles with the very
// same textures. Returns how far the vertex that moved most has moved.
double ExpectOnlyVerticesMoved(const MeshSnapshot& before, const MeshSnapshot& after) {
  EXPECT_EQ(after.vertices_in_map.size(), before.vertices_in_map.size());
  const std::map<Corners, const LtrSnapshot*> old_ltrs = LtrsByCorners(before);
  EXPECT_EQ(LtrsByCorners(after).size(), old_ltrs.size());
  for (const LtrSnapshot& ltr : after.ltrs) {
    const auto found = old_ltrs.find(ltr.vertices);
    if (found == old_ltrs.end()) {
      ADD_FAILURE() << "a triangle that was not there before";
      continue;
    }
    EXPECT_EQ(ltr.occupancy, found->second->occupancy);
    EXPECT_EQ(ltr.moving, found->second->moving);
  }
  double furthest_m = 0.0;
  for (std::size_t i = 0; i < before.vertices_in_map.size(); ++i) {
    furthest_m =
        std::max(furthest_m, (after.vertices_in_map[i] - before.vertices_in_map[i]).norm());
  }
  return furthest_m;
}

TEST(MappingTest, AClosureWritesNoCellAndTheMapFollowsItsVertices) {
  const SimulatedMap loop = DriveAroundTheBlock(4);
  Engine engine;
  std::shared_ptr<const Snapshot> before;
  int closures = 0;
  double furthest_m = 0.0;
  for (const Event& event : loop.events) {
    const Effects effects = engine.Apply(event);
    const std::shared_ptr<const Snapshot> after = engine.TakeSnapshot();
    EXPECT_EQ(after->cells_written.closure, 0U);
    // Consolidation and remeshing of the same event do write; where neither has work, nothing may.
    if (effects.closure_accepted && !after->mesh->ltrs.empty() &&
        after->cells_written.consolidate == before->cells_written.consolidate &&
        after->cells_written.remesh == before->cells_written.remesh) {
      ++closures;
      furthest_m = std::max(furthest_m, ExpectOnlyVerticesMoved(*before->mesh, *after->mesh));
    }
    before = after;
  }
  EXPECT_GE(closures, 1);
  EXPECT_GT(furthest_m, 0.01);
}

TEST(MappingTest, AClosureSaysHowManyPlacesItMoved) {
  const SimulatedMap loop = DriveAroundTheBlock(4);
  Engine engine;
  std::shared_ptr<const Snapshot> before = engine.TakeSnapshot();
  std::uint32_t most_moved = 0;
  for (const Event& event : loop.events) {
    const Effects effects = engine.Apply(event);
    const std::shared_ptr<const Snapshot> after = engine.TakeSnapshot();
    std::uint32_t moved = 0;
    for (std::size_t i = 0; i < before->places.size(); ++i) {
      const Pose2 step =
          Inverse(before->places[i].map_from_place) * after->places[i].map_from_place;
      moved += step.translation().norm() > 1e-3 || std::abs(step.theta) > 1e-3 ? 1U : 0U;
    }
    EXPECT_EQ(effects.places_moved, moved);
    EXPECT_TRUE(effects.closure_accepted || moved == 0);
    most_moved = std::max(most_moved, moved);
    before = after;
  }
  EXPECT_GT(most_moved, 3U);
}

TEST(MappingTest, ClosingASessionDrainsAllWork) {
  const SimulatedMap loop = DriveAroundTheBlock(5);
  Engine engine = EngineOf(loop.events);
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  for (const PlaceSnapshot& place : snapshot->places) {
    EXPECT_TRUE(place.finished) << place.id.value;
    const bool provisional = std::any_of(
        snapshot->closures->begin(), snapshot->closures->end(), [&](const auto& closure) {
          return closure.state == ClosureState::kProvisional &&
                 (closure.from == place.id || closure.to == place.id);
        });
    EXPECT_TRUE(place.consolidated || provisional) << place.id.value;
  }
  EXPECT_GT(snapshot->mesh->ltrs.size(), 4U);
  const Digest digest = engine.StateDigest();
  // Nothing is left over that a later event would work off: only what it says itself changes.
  const CellsWritten written = snapshot->cells_written;
  engine.Apply(OpenSessionEvent{"later", "robot", {}});
  EXPECT_NE(engine.StateDigest(), digest);
  EXPECT_EQ(engine.TakeSnapshot()->cells_written.consolidate, written.consolidate);
  EXPECT_EQ(engine.TakeSnapshot()->cells_written.remesh, written.remesh);
}

TEST(MappingTest, ASecondSessionMatchesTheFirst) {
  const SimulatedMap first = DriveAroundTheBlock(6);
  const SimulatedMap second = DriveAroundTheBlock(7);
  Engine engine = EngineOf(first.events);
  // The second robot was set down a little off its mark.
  const Pose2 start = second.map_from_robot[0] * Pose2{0.08, -0.06, 0.02};
  engine.Apply(OpenSessionEvent{"second", "robot", start});
  for (std::size_t i = 2; i + 1 < second.events.size(); ++i) {
    ObservationEvent event = std::get<ObservationEvent>(second.events[i]);
    event.session = SessionId{1};
    engine.Apply(event);
  }
  engine.Apply(CloseSessionEvent{SessionId{1}});
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  EXPECT_LT(MeanErrorM(TrajectoryOf(*snapshot, SessionId{1}), second.map_from_robot), 0.06);
  std::size_t between = 0;
  for (const ConstraintSnapshot& constraint : *snapshot->constraints) {
    between += constraint.closure && snapshot->places[constraint.from.value].session !=
                                         snapshot->places[constraint.to.value].session
                   ? 1U
                   : 0U;
  }
  EXPECT_GE(between, 5U);
}

// A corridor along x with doors every 3 m on both sides, all alike.
SimulatedWorld SelfSimilarCorridor() {
  SimulatedWorld world;
  for (int door = -5; door < 25; ++door) {
    const double x = 3.0 * door;
    for (const double side : {-1.2, 1.2}) {
      const double back = side * 1.25;
      world.AddWall({x, side}, {x + 2.0, side});
      world.AddWall({x + 2.0, side}, {x + 2.0, back});
      world.AddWall({x + 2.0, back}, {x + 3.0, back});
      world.AddWall({x + 3.0, back}, {x + 3.0, side});
    }
  }
  return world;
}

TEST(MappingTest, InASelfSimilarCorridorNoFalseClosureIsAccepted) {
  const std::vector<Pose2> poses = DriveAlong({{0.0, 0.0}, {45.0, 0.0}}, 0.16);
  Engine engine;
  engine.Apply(CreateMapEvent{ShortPlaces()});
  engine.Apply(OpenSessionEvent{"corridor", "robot", {}});
  Scanner scanner;
  scanner.range_max_m = 10.0;
  const DriftOptions drift{.scale = 0.93, .sigma_part = 0.05};
  for (const Event& event :
       ObservationsAlong(SelfSimilarCorridor(), poses, scanner, drift, SessionId{0}, 8)) {
    engine.Apply(event);
  }
  engine.Apply(CloseSessionEvent{SessionId{0}});
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  const std::vector<Pose2> trajectory = TrajectoryOf(*snapshot, SessionId{0});
  // Where a place truly is: at the true pose of the first scan in it.
  std::vector<Pose2> true_places(snapshot->places.size());
  std::vector<bool> seen(snapshot->places.size(), false);
  std::size_t index = 0;
  for (const auto& piece : snapshot->sessions[0].trajectory) {
    for (const TrajectoryPose& pose : *piece) {
      if (!seen[pose.place.value]) {
        seen[pose.place.value] = true;
        true_places[pose.place.value] = poses[index] * Inverse(pose.place_from_robot);
      }
      ++index;
    }
  }
  EXPECT_FALSE(snapshot->closures->empty());  // it was tempted
  for (const ClosureSnapshot& closure : *snapshot->closures) {
    if (closure.state != ClosureState::kAccepted) {
      continue;
    }
    const Pose2 truth = Inverse(true_places[closure.from.value]) * true_places[closure.to.value];
    const Pose2 error = Inverse(truth) * closure.from_from_to;
    EXPECT_LT(error.translation().norm(), 0.5) << closure.from.value << " " << closure.to.value;
  }
}

TEST(MappingTest, SessionsThatSayNothingLeaveTheMapWhole) {
  Engine engine;
  engine.Apply(CreateMapEvent{});
  engine.Apply(OpenSessionEvent{"silent", "robot", {}});
  engine.Apply(CloseSessionEvent{SessionId{0}});
  engine.Apply(OpenSessionEvent{"odometry", "robot", {1.0, 2.0, 0.5}});
  for (std::uint64_t i = 1; i <= 30; ++i) {
    ObservationEvent event;
    event.session = SessionId{1};
    event.number = i;
    event.stamp_ns = static_cast<std::int64_t>(i);
    event.odometry = Odometry{{10.0, 0.0, 0.0}, {0.01, 0.0, 0.0, 0.01, 0.0, 0.001}};
    engine.Apply(event);
  }
  engine.Apply(RefuseObservationEvent{SessionId{1}, 31, "late"});
  engine.Apply(CloseSessionEvent{SessionId{1}});
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  EXPECT_EQ(snapshot->sessions[1].accepted_count, 30U);
  EXPECT_EQ(snapshot->sessions[1].refused_count, 1U);
  EXPECT_NEAR(snapshot->sessions[1].map_from_robot.x, 1.0 + 300.0 * std::cos(0.5), 1e-6);
  EXPECT_TRUE(Engine::FromRecords(engine.ChangesSince(EventNumber{0}).written).ok());
}

TEST(MappingTest, WhatIsSeenAfterADriveWithoutScansCanBeStored) {
  const SimulatedWorld room = FurnishedRoom();
  RandomSequence noise(1);
  for (const double cell_size_m : {0.05, 0.01}) {
    MapSettings settings;
    settings.cell_size_m = cell_size_m;
    Engine engine;
    engine.Apply(CreateMapEvent{settings});
    engine.Apply(OpenSessionEvent{"far", "robot", {}});
    for (std::uint64_t i = 1; i <= 8; ++i) {
      ObservationEvent event;
      event.number = i;
      event.stamp_ns = static_cast<std::int64_t>(i);
      event.odometry = Odometry{{900.0, 0.0, 0.0}, {0.01, 0.0, 0.0, 0.01, 0.0, 0.001}};
      if (i == 8) {
        event.scan = room.Scan({}, Scanner(), noise);
      }
      engine.Apply(event);
    }
    const StatusOr<Engine> reloaded =
        Engine::FromRecords(engine.ChangesSince(EventNumber{0}).written);
    ASSERT_TRUE(reloaded.ok()) << reloaded.status().ToString();
    EXPECT_EQ(reloaded->StateDigest(), engine.StateDigest());
    engine.Apply(CloseSessionEvent{SessionId{0}});
    EXPECT_TRUE(Engine::FromRecords(engine.ChangesSince(EventNumber{0}).written).ok());
  }
}

TEST(MappingTest, OdometryOfEveryCertaintyThatAnEventMayHaveIsMapped) {
  // Without scans, so that places are tied by odometry alone: a turn by nobody knows how much, and
  // steps that are known to a tenth of a micrometre.
  for (const double step_m : {5.0, 50.0, 999.0}) {
    for (const double variance_rad2 : {1.0, 1e4, 1e6}) {
      Engine engine;
      engine.Apply(CreateMapEvent{MapSettings{}});
      engine.Apply(OpenSessionEvent{"exact", "robot", {}});
      for (std::uint64_t i = 1; i <= 300; ++i) {
        ObservationEvent event;
        event.number = i;
        event.stamp_ns = static_cast<std::int64_t>(i);
        const double direction = 0.7 * static_cast<double>(i);
        event.odometry =
            i % 2 == 1 ? Odometry{{}, {1e-14, 0.0, 0.0, 1e-14, 0.0, variance_rad2}}
                       : Odometry{{step_m * std::cos(direction), step_m * std::sin(direction), 0.1},
                                  {1e-14, 0.0, 0.0, 1e-14, 0.0, 1e-14}};
        ASSERT_THAT(ValidateObservation(event, "observation"), IsOk());
        engine.Apply(event);
      }
      engine.Apply(CloseSessionEvent{SessionId{0}});
      const StatusOr<Engine> reloaded =
          Engine::FromRecords(engine.ChangesSince(EventNumber{0}).written);
      ASSERT_THAT(reloaded, IsOk());
      EXPECT_EQ(reloaded->StateDigest(), engine.StateDigest());
    }
  }
}

}  // namespace
}  // namespace loci
