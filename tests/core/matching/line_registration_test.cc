// SPDX-License-Identifier: Apache-2.0
#include "core/matching/line_registration.h"

#include <gtest/gtest.h>

#include "core/geometry/covariance.h"
#include "tests/support/patches.h"

namespace loci {
namespace {

Pose2 RandomOffset(RandomSequence& random, double reach_m, double reach_rad) {
  return {random.NextUniform(-reach_m, reach_m),
          random.NextUniform(-reach_m, reach_m),
          random.NextUniform(-reach_rad, reach_rad)};
}

TEST(LineRegistrationTest, FindsKnownOffsetsInARoomToBelowACentimetre) {
  RandomSequence random(1);
  const Patch patch = PatchOfRoom(random);
  const SimulatedWorld world = FurnishedRoom();
  for (int round = 0; round < 40; ++round) {
    const Pose2 pose = RandomOffset(random, 1.2, 3.0);
    const std::vector<Eigen::Vector2d> points =
        PointsOf(world.Scan(pose, FullTurnScanner(360), random));
    const Pose2 start = pose * RandomOffset(random, 0.06, 0.02);
    const Registration result = RegisterToLines(points, start, patch, {});
    const Pose2 error = Inverse(pose) * result.patch_from_robot;
    EXPECT_LT(error.translation().norm(), 0.01) << round;
    EXPECT_LT(std::abs(error.theta), 0.003) << round;
    EXPECT_GT(result.inlier_count, points.size() * 8 / 10) << round;
    EXPECT_LT(result.mean_residual_m, 0.02) << round;
  }
}

// The patch of two long walls that meet at a right angle, without noise.
Patch ExactCorner() {
  Patch patch;
  for (int i = 0; i < 2000; ++i) {
    patch.Add({0.0025 * i, 0.0}, PatchContent::kOwn);
    patch.Add({0.0, 0.0025 * i + 0.0025}, PatchContent::kOwn);
  }
  return patch;
}

std::vector<Eigen::Vector2d> CornerPoints(const Pose2& patch_from_robot) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 10; i < 90; ++i) {
    points.push_back(Inverse(patch_from_robot) * Eigen::Vector2d(0.05 * i, 0.0));
    points.push_back(Inverse(patch_from_robot) * Eigen::Vector2d(0.0, 0.05 * i));
  }
  return points;
}

TEST(LineRegistrationTest, ConvergesAsFastAsARightJacobianMakesItIn) {
  const Patch patch = ExactCorner();
  const Pose2 pose{2.0, 1.5, 0.9};
  const std::vector<Eigen::Vector2d> points = CornerPoints(pose);
  RandomSequence random(2);
  for (int round = 0; round < 20; ++round) {
    const Pose2 start = pose * RandomOffset(random, 0.02, 0.01);
    RegistrationOptions options;
    options.iterations_max = 6;
    const Pose2 error =
        Inverse(pose) * RegisterToLines(points, start, patch, options).patch_from_robot;
    // Robust weights change from step to step, so steps shrink by a factor and not quadratically.
    EXPECT_LT(error.translation().norm(), 1e-3) << round;
    EXPECT_LT(std::abs(error.theta), 1e-3) << round;
  }
}

TEST(LineRegistrationTest, TheInformationIsTheSumOfSquaredNumericDerivatives) {
  const Patch patch = ExactCorner();
  const Pose2 pose{2.0, 1.5, 0.9};
  const std::vector<Eigen::Vector2d> points = CornerPoints(pose);
  RegistrationOptions options;
  const Registration result = RegisterToLines(points, pose, patch, options);
  // Residuals of the exact corner: y for points on the wall along x, x for the others.
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  constexpr double kStep = 1e-6;
  for (const Eigen::Vector2d& point : points) {
    const bool on_x = std::abs((pose * point).y()) < 1e-6;
    Eigen::Vector3d jacobian;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Eigen::Vector3d xi = kStep * Eigen::Vector3d::Unit(k);
      const Eigen::Vector2d ahead = pose * Exp(xi) * point;
      const Eigen::Vector2d behind = pose * Exp(-xi) * point;
      const Eigen::Vector2d derivative = (ahead - behind) / (2.0 * kStep);
      jacobian(k) = on_x ? derivative.y() : derivative.x();
    }
    expected += jacobian * jacobian.transpose() / (kLineSigmaM * kLineSigmaM);
  }
  EXPECT_LT((result.information - expected).norm(), 0.05 * expected.norm());
}

TEST(LineRegistrationTest, ThePriorKeepsTheOpenDirectionOfACorridor) {
  RandomSequence random(3);
  const SimulatedWorld world = StraightCorridor();
  const Patch patch =
      PatchOf(world, {{}, {0.5, 0.0, 0.1}, {1.0, 0.1, 0.0}}, FullTurnScanner(720), random);
  const Pose2 pose{0.4, 0.2, 0.05};
  const std::vector<Eigen::Vector2d> points =
      PointsOf(world.Scan(pose, FullTurnScanner(360), random), 8.0);
  RegistrationOptions options;
  options.prior_patch_from_robot = {0.6, 0.15, 0.08};  // wrong in all directions
  options.prior_information = Covariance3::FromSigmas(0.1, 0.1, 0.05).Information();
  const Registration result =
      RegisterToLines(points, options.prior_patch_from_robot, patch, options);
  EXPECT_NEAR(result.patch_from_robot.x, 0.6, 0.03);  // as the prior has it: nothing says other
  EXPECT_NEAR(result.patch_from_robot.y, pose.y, 0.01);
  EXPECT_NEAR(result.patch_from_robot.theta, pose.theta, 0.005);
}

TEST(LineRegistrationTest, WithoutAnythingToRegisterToThePoseStays) {
  const Pose2 start{1.0, 2.0, 0.5};
  const std::vector<Eigen::Vector2d> points = {{1.0, 0.0}, {0.0, 1.0}};
  const Registration nothing = RegisterToLines(points, start, Patch(), {});
  EXPECT_EQ(nothing.patch_from_robot, start);
  EXPECT_EQ(nothing.inlier_count, 0U);
  EXPECT_EQ(nothing.information, Eigen::Matrix3d::Zero());
  Patch single;
  single.Add(start * points[0], PatchContent::kOwn);
  EXPECT_EQ(RegisterToLines(points, start, single, {}).inlier_count, 0U);  // a point is no line
}

TEST(LineRegistrationTest, OutliersDoNotPullTheResultAway) {
  RandomSequence random(4);
  const Patch patch = PatchOfRoom(random);
  const Pose2 pose{0.3, -0.4, 1.0};
  std::vector<Eigen::Vector2d> points =
      PointsOf(FurnishedRoom().Scan(pose, FullTurnScanner(360), random));
  for (std::size_t i = 0; i < points.size(); i += 5) {
    points[i] *= 1.0 - 0.15 / points[i].norm();  // someone leans against every wall
  }
  const Registration result = RegisterToLines(points, pose * Pose2{0.04, -0.03, 0.01}, patch, {});
  const Pose2 error = Inverse(pose) * result.patch_from_robot;
  EXPECT_LT(error.translation().norm(), 0.01);
  EXPECT_LT(std::abs(error.theta), 0.003);
}

}  // namespace
}  // namespace loci
