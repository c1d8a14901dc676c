// SPDX-License-Identifier: Apache-2.0
// Closures in simulated buildings, held against the truth.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <ostream>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "clients/log/odometry_model.h"
#include "clients/simulator/simulation.h"
#include "core/engine/engine.h"

namespace loci {
namespace {

using simulator::Scenario;
using simulator::SimulatedScan;
using simulator::SimulatedSession;

LaserScan ScanOf(const SimulatedSession& session, const SimulatedScan& simulated) {
  LaserScan scan;
  scan.robot_from_laser = session.laser.robot_from_laser;
  scan.angle_min_rad = session.laser.angle_min_rad;
  scan.angle_step_rad = session.laser.angle_step_rad;
  for (const double range_m : simulated.ranges_m) {
    scan.ranges_mm.push_back(range_m < session.laser.range_max_m
                                 ? static_cast<std::uint16_t>(std::lround(1000.0 * range_m))
                                 : LaserScan::kNothingSeen);
  }
  return scan;
}

// What the odometry of the first session tells of a motion that never was.
struct Slip {
  std::size_t scan = 0;  // the one before which it happens; 0: none
  double along_m = 0.0;
  double sigma_m = 0.0;  // the doubt that the odometry has about it
};

// The engine after all sessions of a scenario. Robots of one day stream at the same time.
Engine MapOf(const std::vector<SimulatedSession>& sessions, const Slip& slip = {}) {
  Engine engine;
  engine.Apply(CreateMapEvent{});
  // By day, stamp and session: which scan comes when.
  std::vector<std::tuple<std::uint64_t, std::int64_t, std::uint32_t, std::size_t>> order;
  for (std::uint32_t id = 0; id < sessions.size(); ++id) {
    for (std::size_t i = 0; i < sessions[id].scans.size(); ++i) {
      order.emplace_back(sessions[id].day, sessions[id].scans[i].stamp_ns, id, i);
    }
  }
  std::sort(order.begin(), order.end());
  for (const SimulatedSession& session : sessions) {
    engine.Apply(OpenSessionEvent{session.session, session.robot, session.map_from_start});
  }
  for (const auto& [day, stamp_ns, id, i] : order) {
    const SimulatedSession& session = sessions[id];
    ObservationEvent event;
    event.session = SessionId{id};
    event.number = i + 1;
    event.stamp_ns = stamp_ns;
    if (i > 0) {
      const Pose2 motion =
          Inverse(session.scans[i - 1].odom_from_robot) * session.scans[i].odom_from_robot;
      event.odometry = Odometry{motion, OdometryCovarianceUpper(motion)};
      if (id == 0 && i == slip.scan) {
        event.odometry->previous_from_robot.x += slip.along_m;
        event.odometry->covariance_upper[0] += slip.sigma_m * slip.sigma_m;
      }
    }
    event.scan = ScanOf(session, session.scans[i]);
    engine.Apply(event);
    if (i + 1 == session.scans.size()) {
      engine.Apply(CloseSessionEvent{SessionId{id}});
    }
  }
  return engine;
}

// Where every place truly is: where the first scan in it was truly taken.
std::vector<Pose2> TruePlaces(const Snapshot& snapshot,
                              const std::vector<SimulatedSession>& sessions) {
  std::vector<Pose2> map_from_place(snapshot.places.size());
  std::vector<bool> seen(snapshot.places.size(), false);
  for (std::size_t id = 0; id < sessions.size(); ++id) {
    std::size_t index = 0;
    for (const auto& piece : snapshot.sessions[id].trajectory) {
      for (const TrajectoryPose& pose : *piece) {
        if (!seen[pose.place.value]) {
          seen[pose.place.value] = true;
          map_from_place[pose.place.value] =
              sessions[id].scans[index].map_from_robot * Inverse(pose.place_from_robot);
        }
        ++index;
      }
    }
  }
  return map_from_place;
}

// How a closure's measurement differs from the truth.
Pose2 ErrorOf(const ClosureSnapshot& closure, const std::vector<Pose2>& map_from_place) {
  const Pose2 truth =
      Inverse(map_from_place[closure.from.value]) * map_from_place[closure.to.value];
  return Inverse(truth) * closure.from_from_to;
}

// The first scan of a place stands for all of it, and a place bends by its own drift: 0.3 m at most
// in these buildings, where the nearest copy of a room is 6 m away. A closure that is off by more
// than half a metre, or by 0.05 rad (20 cm over a place), joined what does not belong together.
constexpr double kFalseFromM = 0.5;
constexpr double kFalseFromRad = 0.05;

bool IsTrue(const ClosureSnapshot& closure, const std::vector<Pose2>& map_from_place) {
  const Pose2 error = ErrorOf(closure, map_from_place);
  return error.translation().norm() < kFalseFromM && std::abs(error.theta) < kFalseFromRad;
}

std::string Describe(const ClosureSnapshot& closure, const std::vector<Pose2>& map_from_place) {
  const Pose2 error = ErrorOf(closure, map_from_place);
  return "place " + std::to_string(closure.from.value) + " to " + std::to_string(closure.to.value) +
         ": off by " + std::to_string(error.translation().norm()) + " m, " +
         std::to_string(error.theta) + " rad";
}

struct Building {
  std::string scenario;
  std::uint64_t seed = 0;
};

void PrintTo(const Building& building, std::ostream* out) {
  *out << building.scenario << ", seed " << building.seed;
}

class ClosuresTest : public testing::TestWithParam<Building> {};

TEST_P(ClosuresTest, SomeAreAcceptedAndEachOfThemIsTrue) {
  const StatusOr<Scenario> scenario = simulator::MakeScenario(GetParam().scenario);
  ASSERT_TRUE(scenario.ok()) << scenario.status().ToString();
  const std::vector<SimulatedSession> sessions = simulator::Simulate(*scenario, GetParam().seed);
  Engine engine = MapOf(sessions);
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  const std::vector<Pose2> map_from_place = TruePlaces(*snapshot, sessions);
  // Of those that looked alike some were refused: it is a choice, not a habit.
  EXPECT_GT(snapshot->closures->size(), snapshot->closures_accepted);
  EXPECT_GE(snapshot->closures_accepted, 5U);
  for (const ClosureSnapshot& closure : *snapshot->closures) {
    EXPECT_TRUE(closure.state != ClosureState::kAccepted || IsTrue(closure, map_from_place))
        << Describe(closure, map_from_place);
  }
}

INSTANTIATE_TEST_SUITE_P(Buildings,
                         ClosuresTest,
                         testing::Values(Building{"self-similar", 0},
                                         Building{"self-similar", 1},
                                         Building{"self-similar", 2},
                                         Building{"office", 0},
                                         Building{"office", 1},
                                         Building{"loop", 0},
                                         Building{"loop", 1}),
                         [](const auto& instance) {
                           std::string name = instance.param.scenario;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name + "_" + std::to_string(instance.param.seed);
                         });

// A robot drives out and back along a corridor of equal blocks, whose ends it never sees. When it
// turns back its wheels slip: its odometry tells of metres that it did not drive, and that it may
// be wrong by four. Where it then believes to be, everything looks as it should.
class LostAmongCopiesTest : public testing::TestWithParam<double> {};

TEST_P(LostAmongCopiesTest, NoCopyIsTakenForAnother) {
  StatusOr<Scenario> scenario = simulator::MakeScenario("self-similar");
  ASSERT_TRUE(scenario.ok()) << scenario.status().ToString();
  simulator::SessionPlan& plan = scenario->sessions.front();
  plan.waypoints = {{10.0, 1.2}, {50.0, 1.2}, {50.0, 1.4}, {10.0, 1.4}};
  plan.laser.range_max_m = 8.0;
  const std::vector<SimulatedSession> sessions = simulator::Simulate(*scenario, 0);
  Engine engine = MapOf(
      sessions, {.scan = sessions.front().scans.size() / 2, .along_m = GetParam(), .sigma_m = 4.0});
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  const std::vector<Pose2> map_from_place = TruePlaces(*snapshot, sessions);
  std::size_t ambiguous = 0;
  for (const ClosureSnapshot& closure : *snapshot->closures) {
    ambiguous += closure.reason.find("second peak") != std::string::npos ? 1U : 0U;
    EXPECT_TRUE(closure.state != ClosureState::kAccepted || IsTrue(closure, map_from_place))
        << Describe(closure, map_from_place);
  }
  EXPECT_GE(ambiguous, 3U);  // the robot was tempted
}

// Half a room, a room, and a block too far; a room too short.
INSTANTIATE_TEST_SUITE_P(Slips, LostAmongCopiesTest, testing::Values(3.0, 6.0, 12.0, -6.0));

}  // namespace
}  // namespace loci
