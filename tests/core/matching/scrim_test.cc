// SPDX-License-Identifier: Apache-2.0
#include "core/matching/scrim.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "tests/support/patches.h"

namespace loci {
namespace {

Covariance3 CovarianceIn(const SimulatedWorld& world,
                         const Pose2& pose,
                         double range_max_m,
                         std::uint64_t seed) {
  RandomSequence noise(9);
  // Seen from elsewhere, so that the beams' own pattern does not say where the robot is.
  std::vector<Pose2> poses;
  for (int i = 0; i < 10; ++i) {
    poses.push_back(pose * Pose2{0.21 * i - 0.9, 0.03 * (i % 3), 0.13 * i});
  }
  const Patch patch = PatchOf(world, poses, FullTurnScanner(360), noise);
  const std::vector<Eigen::Vector2d> points =
      PointsOf(world.Scan(pose, FullTurnScanner(360), noise), range_max_m);
  SamplingOptions options;
  options.seed = seed;
  return SampleMatchCovariance(points, pose, patch, LikelihoodGrid::OfPatch(patch, 1), options);
}

TEST(ScrimTest, ARoomLeavesNoDirectionOpen) {
  const Eigen::Matrix3d covariance =
      CovarianceIn(FurnishedRoom(), {0.2, 0.1, 0.4}, 15.0, 1).matrix();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance.topLeftCorner<2, 2>());
  EXPECT_GT(solver.eigenvalues()(0), 0.0);
  EXPECT_LT(std::sqrt(solver.eigenvalues()(1)), 0.05);
  EXPECT_LT(std::sqrt(covariance(2, 2)), 0.02);
}

TEST(ScrimTest, ACorridorGivesALongEllipseAlongTheCorridor) {
  for (const double heading_rad : {0.0, 0.6, -2.0}) {
    const Pose2 pose{0.5, 0.2, heading_rad};
    const Eigen::Matrix3d covariance = CovarianceIn(StraightCorridor(), pose, 6.0, 1).matrix();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance.topLeftCorner<2, 2>());
    const double across_m = std::sqrt(solver.eigenvalues()(0));
    const double along_m = std::sqrt(solver.eigenvalues()(1));
    EXPECT_GT(along_m, 4.0 * across_m) << heading_rad;
    // The covariance lies along the robot's axes; the corridor runs along the map's x.
    const Eigen::Vector2d axis = Transformer2(pose).Rotate(solver.eigenvectors().col(1));
    EXPECT_GT(std::abs(axis.x()), 0.99) << heading_rad;
  }
}

TEST(ScrimTest, TheFloorStandsForWhatSamplingCannotSee) {
  const Eigen::Matrix3d covariance = CovarianceIn(FurnishedRoom(), {}, 15.0, 1).matrix();
  const Eigen::Vector3d floor(0.01, 0.01, 0.003);
  const Eigen::Matrix3d above = covariance - Eigen::Matrix3d(floor.cwiseAbs2().asDiagonal());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(above);
  EXPECT_GT(solver.eigenvalues()(0), -1e-12);
}

TEST(ScrimTest, TheSameSeedGivesTheSameBits) {
  const Eigen::Matrix3d first = CovarianceIn(FurnishedRoom(), {}, 15.0, 7).matrix();
  EXPECT_EQ(first, CovarianceIn(FurnishedRoom(), {}, 15.0, 7).matrix());
  EXPECT_NE(first, CovarianceIn(FurnishedRoom(), {}, 15.0, 8).matrix());
}

TEST(ScrimTest, WithoutPointsOrPatchTheCovarianceIsStillOne) {
  const Patch patch;
  const LikelihoodGrid grid = LikelihoodGrid::OfPatch(patch, 1);
  const Covariance3 covariance = SampleMatchCovariance({}, {}, patch, grid, {});
  EXPECT_GT(covariance.matrix().determinant(), 0.0);
}

}  // namespace
}  // namespace loci
