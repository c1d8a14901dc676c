// SPDX-License-Identifier: Apache-2.0
#include "core/scan/scan_points.h"

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/support/generator.h"

namespace loci {
namespace {

TEST(ScanPointsTest, PointsLieWhereTheBeamsEnd) {
  LaserScan scan;
  scan.robot_from_laser = {0.5, -0.2, 0.5 * kPi};
  scan.angle_min_rad = -0.5 * kPi;
  scan.angle_step_rad = 0.5 * kPi;
  scan.ranges_mm = {1000, 2000, 3000};
  const std::vector<ScanPoint> points = ToPoints(scan, 10.0);
  ASSERT_EQ(points.size(), 3U);
  EXPECT_LT((points[0].point_in_robot - Eigen::Vector2d(1.5, -0.2)).norm(), 1e-12);
  EXPECT_LT((points[1].point_in_robot - Eigen::Vector2d(0.5, 1.8)).norm(), 1e-12);
  EXPECT_LT((points[2].point_in_robot - Eigen::Vector2d(-2.5, -0.2)).norm(), 1e-12);
}

TEST(ScanPointsTest, ReadingsOutsideTheBoundsAreLeftOutAndTheOthersKeepTheirBeam) {
  LaserScan scan;
  scan.angle_step_rad = 0.1;
  scan.ranges_mm = {0, 49, 50, 51, 5000, 10000, 10001, LaserScan::kNothingSeen, 7000};
  const std::vector<ScanPoint> points = ToPoints(scan, 10.0);
  std::vector<std::uint32_t> beams;
  for (const ScanPoint& point : points) {
    beams.push_back(point.beam);
  }
  EXPECT_EQ(beams, (std::vector<std::uint32_t>{2, 3, 4, 5, 8}));
  EXPECT_TRUE(ToPoints(LaserScan(), 10.0).empty());
}

TEST(ScanPointsTest, TheSameWallIsSeenFromEverywhere) {
  SimulatedWorld world;
  world.AddBox({-3.0, -2.0}, {4.0, 5.0});
  Scanner scanner = FullTurnScanner(360);
  scanner.sigma_m = 0.0;
  scanner.robot_from_laser = {0.3, 0.1, 1.0};
  RandomSequence random(1);
  for (int i = 0; i < 20; ++i) {
    const Pose2 pose{random.NextUniform(-2.0, 3.0),
                     random.NextUniform(-1.0, 4.0),
                     random.NextUniform(-3.0, 3.0)};
    const std::vector<ScanPoint> points = ToPoints(world.Scan(pose, scanner, random), 30.0);
    ASSERT_EQ(points.size(), 360U);
    for (const ScanPoint& point : points) {
      const Eigen::Vector2d in_map = pose * point.point_in_robot;
      const double to_wall = std::min({std::abs(in_map.x() + 3.0),
                                       std::abs(in_map.x() - 4.0),
                                       std::abs(in_map.y() + 2.0),
                                       std::abs(in_map.y() - 5.0)});
      EXPECT_LT(to_wall, 0.0006);  // ranges are whole millimetres
    }
  }
}

}  // namespace
}  // namespace loci
