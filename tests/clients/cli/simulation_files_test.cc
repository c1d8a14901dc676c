// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/simulation_files.h"

#include <cmath>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cli/evaluation.h"
#include "clients/log/carmen_reader.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_directory.h"

namespace loci::cli {
namespace {

TEST(SimulationFilesTest, WritesALogThatReadsBackAsItWasSimulated) {
  const TemporaryDirectory folder;
  simulator::Scenario scenario = simulator::MakeScenario("office").value();
  const auto sessions = simulator::Simulate(scenario, 5);
  ASSERT_THAT(WriteSimulation(folder.path().string(), scenario, 5, sessions), IsOk());
  const auto& session = sessions[1];
  const auto reader = CarmenReader::Open((folder.path() / "r2-1.clf").string());
  ASSERT_THAT(reader, IsOk());
  ASSERT_EQ((*reader)->scan_count(), session.scans.size());
  for (const simulator::SimulatedScan& truth : session.scans) {
    const auto next = (*reader)->Next();
    ASSERT_THAT(next, IsOk());
    const LogScan& scan = **next;
    ASSERT_EQ(scan.stamp_ns, truth.stamp_ns);
    ASSERT_NEAR(scan.odom_from_robot.x, truth.odom_from_robot.x, 1e-6);
    ASSERT_NEAR(scan.robot_from_laser.x, session.laser.robot_from_laser.x, 1e-5);
    ASSERT_NEAR(scan.robot_from_laser.y, session.laser.robot_from_laser.y, 1e-5);
    ASSERT_NEAR(scan.angle_step_rad, session.laser.angle_step_rad, 1e-12);
    for (std::size_t beam = 0; beam < truth.ranges_m.size(); ++beam) {
      const bool seen = truth.ranges_m[beam] < session.laser.range_max_m;
      ASSERT_EQ(seen, scan.ranges_mm[beam] != LogScan::kNothingSeen);
      ASSERT_TRUE(!seen || std::abs(scan.ranges_mm[beam] - 1000.0 * truth.ranges_m[beam]) < 0.51);
    }
  }
  const auto truth = ReadTumFile((folder.path() / "r2-1.truth.tum").string());
  ASSERT_THAT(truth, IsOk());
  EXPECT_EQ(truth->size(), session.scans.size());
  std::ifstream summary(folder.path() / "scenario.json");
  const std::string text((std::istreambuf_iterator<char>(summary)), {});
  EXPECT_THAT(text, testing::HasSubstr(R"("log":"r2-1.clf")"));
  EXPECT_THAT(text, testing::HasSubstr(R"("floor_plan":"plan.yaml")"));
}

TEST(SimulationFilesTest, ShowsInThePlanWhatBeamsHit) {
  simulator::Scenario scenario = simulator::MakeScenario("long-corridor").value();
  const auto session = simulator::Simulate(scenario, 0).front();
  const OccupancyMap plan =
      FloorPlanOf(scenario.plan, 0, 0, session.map_from_start.translation(), 0.05);
  std::size_t hits = 0;
  std::size_t on_surface = 0;
  for (std::size_t i = 0; i < session.scans.size(); i += 20) {
    const simulator::SimulatedScan& scan = session.scans[i];
    for (std::size_t beam = 0; beam < scan.ranges_m.size(); beam += 5) {
      if (scan.ranges_m[beam] > 5.0) {
        continue;
      }
      const double angle_rad =
          session.laser.angle_min_rad + static_cast<double>(beam) * session.laser.angle_step_rad;
      const Eigen::Vector2d point = scan.map_from_robot * session.laser.robot_from_laser *
                                    Eigen::Vector2d(scan.ranges_m[beam] * Cos(angle_rad),
                                                    scan.ranges_m[beam] * Sin(angle_rad));
      const auto column =
          static_cast<std::int32_t>(std::floor((point.x() - plan.x_min_m) / plan.resolution_m));
      const auto row =
          static_cast<std::int32_t>(std::floor((point.y() - plan.y_min_m) / plan.resolution_m));
      bool near = false;
      for (std::int32_t y = row - 1; y <= row + 1; ++y) {
        for (std::int32_t x = column - 1; x <= column + 1; ++x) {
          near = near || plan.at(x, y) == OccupancyMap::Cell::kOccupied;
        }
      }
      ++hits;
      on_surface += near ? 1U : 0U;
    }
  }
  EXPECT_GT(hits, 500U);
  EXPECT_GT(static_cast<double>(on_surface), 0.99 * static_cast<double>(hits));
}

}  // namespace
}  // namespace loci::cli
