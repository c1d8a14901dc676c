// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/observation_maker.h"

#include <gtest/gtest.h>

namespace loci::cli {
namespace {

LogScan At(std::int64_t stamp_ns, const Pose2& odom_from_robot) {
  LogScan scan;
  scan.stamp_ns = stamp_ns;
  scan.odom_from_robot = odom_from_robot;
  scan.robot_from_laser = {0.2, 0.0, 0.1};
  scan.angle_min_rad = -1.5;
  scan.angle_step_rad = 0.01;
  scan.ranges_mm = {1000, LogScan::kNothingSeen, 3};
  return scan;
}

TEST(ObservationMakerTest, SendsTheMotionSinceThePreviousScan) {
  ObservationMaker maker;
  EXPECT_FALSE(maker.Make(At(1, {5.0, 5.0, kPi / 2})).has_odometry());
  const v1::Observation second = maker.Make(At(2, {5.0, 5.5, kPi / 2}));
  EXPECT_NEAR(second.odometry().previous_from_robot().x(), 0.5, 1e-12);
  EXPECT_NEAR(second.odometry().previous_from_robot().y(), 0.0, 1e-12);
  EXPECT_EQ(second.odometry().covariance_size(), 6);
  EXPECT_GT(second.odometry().covariance(0), 0.0);
  EXPECT_EQ(second.scan().ranges_mm(1), 65535U);
  EXPECT_EQ(second.scan().robot_from_laser().x(), 0.2);
}

TEST(ObservationMakerTest, LosesNoMotionOverAScanThatTheServerRefuses) {
  ObservationMaker maker;
  maker.Make(At(10, {0.0, 0.0, 0.0}));
  maker.Make(At(20, {1.0, 0.0, 0.0}));
  maker.Make(At(15, {0.5, 0.0, 0.0}));  // not newer: refused, and its motion with it
  const v1::Observation next = maker.Make(At(30, {2.0, 0.0, 0.0}));
  EXPECT_NEAR(next.odometry().previous_from_robot().x(), 1.0, 1e-12);
}

TEST(ObservationMakerTest, TakesAJumpOfTheOdometryForNoMotion) {
  ObservationMaker maker;
  maker.Make(At(10, {0.0, 0.0, 0.0}));
  EXPECT_FALSE(maker.Make(At(20, {5000.0, 0.0, 0.0})).has_odometry());
  EXPECT_NEAR(
      maker.Make(At(30, {5001.0, 0.0, 0.0})).odometry().previous_from_robot().x(), 1.0, 1e-9);
}

}  // namespace
}  // namespace loci::cli
