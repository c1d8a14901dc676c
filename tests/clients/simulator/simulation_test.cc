// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/simulation.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "clients/simulator/ray_caster.h"

namespace loci::simulator {
namespace {

using Eigen::Vector2d;

Scenario Made(const std::string& name) {
  return MakeScenario(name).value();
}

// Where odometry thinks that the robot is at the end, against where it is.
double DriftOf(const SimulatedSession& session) {
  const Pose2 felt = session.map_from_start * session.scans.back().odom_from_robot;
  return (felt.translation() - session.scans.back().map_from_robot.translation()).norm();
}

bool Equal(const SimulatedSession& a, const SimulatedSession& b) {
  return std::equal(a.scans.begin(),
                    a.scans.end(),
                    b.scans.begin(),
                    b.scans.end(),
                    [](const SimulatedScan& x, const SimulatedScan& y) {
                      return x.stamp_ns == y.stamp_ns && x.map_from_robot == y.map_from_robot &&
                             x.odom_from_robot == y.odom_from_robot && x.ranges_m == y.ranges_m;
                    });
}

TEST(SimulationTest, GivesTheSameToTheLastBitForOneSeedAndAnotherForAnother) {
  const Scenario scenario = Made("self-similar");
  const auto first = Simulate(scenario, 3);
  const auto again = Simulate(scenario, 3);
  const auto other = Simulate(scenario, 4);
  ASSERT_EQ(first.size(), 1U);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_TRUE(Equal(first[i], again[i]));
    EXPECT_FALSE(Equal(first[i], other[i]));
  }
}

TEST(SimulationTest, ShowsEveryScanFromItsTruePose) {
  Scenario scenario = Made("office");
  scenario.sessions.resize(1);
  const SimulatedSession session = Simulate(scenario, 1).front();
  const RayCaster walls(scenario.plan.ComputeSurfaces(0, 1));
  std::size_t compared = 0;
  std::size_t nearer = 0;
  for (std::size_t i = 0; i < session.scans.size(); i += 7) {
    const SimulatedScan& scan = session.scans[i];
    const Pose2 map_from_laser = scan.map_from_robot * session.laser.robot_from_laser;
    for (std::size_t beam = 0; beam < scan.ranges_m.size(); beam += 3) {
      const double angle_rad = map_from_laser.theta + session.laser.angle_min_rad +
                               static_cast<double>(beam) * session.laser.angle_step_rad;
      const double wall_m = walls.Cast(map_from_laser.translation(),
                                       {Cos(angle_rad), Sin(angle_rad)},
                                       session.laser.range_max_m,
                                       scenario.plan.columns());
      if (scan.ranges_m[beam] >= session.laser.range_max_m) {
        continue;
      }
      ++compared;
      EXPECT_LT(scan.ranges_m[beam], wall_m + 6.0 * session.laser.noise_m);
      nearer += scan.ranges_m[beam] < wall_m - 6.0 * session.laser.noise_m ? 1U : 0U;  // people
    }
  }
  EXPECT_GT(compared, 5000U);
  EXPECT_LT(static_cast<double>(nearer), 0.05 * static_cast<double>(compared));
}

TEST(SimulationTest, KeepsRobotsOffWallsAndFurniture) {
  for (const ScenarioName& name : ScenarioNames()) {
    const Scenario scenario = Made(name.name);
    for (const SimulatedSession& session : Simulate(scenario, 2)) {
      const RayCaster caster(scenario.plan.ComputeSurfaces(session.day, 2));
      for (std::size_t i = 0; i < session.scans.size(); i += 9) {
        const Vector2d robot = session.scans[i].map_from_robot.translation();
        double nearest_m = 10.0;
        for (int direction = 0; direction < 24; ++direction) {
          const double angle_rad = direction * kPi / 12.0;
          nearest_m =
              std::min(nearest_m, caster.Cast(robot, {Cos(angle_rad), Sin(angle_rad)}, 10.0, {}));
        }
        ASSERT_GT(nearest_m, 0.25)
            << name.name << ' ' << session.session << " at " << robot.x() << ", " << robot.y();
      }
    }
  }
}

TEST(SimulationTest, DrivesAtTheSpeedOfARobotWithStampsThatGrow) {
  for (const SimulatedSession& session : Simulate(Made("office"), 0)) {
    EXPECT_GT(session.distance_m, 80.0);
    for (std::size_t i = 1; i < session.scans.size(); ++i) {
      const double seconds =
          static_cast<double>(session.scans[i].stamp_ns - session.scans[i - 1].stamp_ns) * 1e-9;
      ASSERT_NEAR(seconds, 0.2, 1e-9);
      const Pose2 step =
          Inverse(session.scans[i - 1].map_from_robot) * session.scans[i].map_from_robot;
      ASSERT_LT(step.translation().norm(), 0.61 * seconds);
      ASSERT_LT(std::abs(step.theta), 0.81 * seconds);
    }
  }
}

TEST(SimulationTest, DriftsByMetresInTheLoopAndLittleInTheOffice) {
  const double loop_m = DriftOf(Simulate(Made("loop"), 0).front());
  EXPECT_GT(loop_m, 5.0);
  EXPECT_LT(loop_m, 150.0);
  EXPECT_LT(DriftOf(Simulate(Made("office"), 0).front()), 15.0);
}

TEST(SimulationTest, MovesFurnitureBetweenDaysButNotWalls) {
  const Scenario scenario = Made("office-days");
  const std::vector<Segment> monday = scenario.plan.ComputeSurfaces(0, 0);
  const std::vector<Segment> tuesday = scenario.plan.ComputeSurfaces(1, 0);
  ASSERT_EQ(monday.size(), tuesday.size());
  std::size_t same = 0;
  for (std::size_t i = 0; i < monday.size(); ++i) {
    same += monday[i].from == tuesday[i].from && monday[i].to == tuesday[i].to ? 1U : 0U;
  }
  EXPECT_LT(same, monday.size());
  EXPECT_GT(same, monday.size() / 2);
}

TEST(SimulationTest, RepeatsRoomsExactlyInTheSelfSimilarBuilding) {
  const Scenario scenario = Made("self-similar");
  const RayCaster caster(scenario.plan.ComputeSurfaces(0, 0));
  for (const Vector2d& block : {Vector2d(24.0, 0.0), Vector2d(24.0, 14.8)}) {
    for (int direction = 0; direction < 360; direction += 7) {
      const double angle_rad = direction * kPi / 180.0;
      const Vector2d beam(Cos(angle_rad), Sin(angle_rad));
      const Vector2d in_room(15.0, 5.0);  // of the second block
      EXPECT_NEAR(
          caster.Cast(in_room, beam, 5.0, {}), caster.Cast(in_room + block, beam, 5.0, {}), 1e-9);
    }
  }
}

TEST(SimulationTest, NamesTheScenariosWhenAskedForAnother) {
  const StatusOr<Scenario> none = MakeScenario("castle");
  EXPECT_EQ(none.status().code(), StatusCode::kNotFound);
  EXPECT_NE(none.status().message().find("self-similar"), std::string::npos);
}

}  // namespace
}  // namespace loci::simulator
