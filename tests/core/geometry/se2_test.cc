// SPDX-License-Identifier: Apache-2.0
#include "core/geometry/se2.h"

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

constexpr int kRounds = 2000;

Pose2 RandomPose(RandomSequence& random, double reach_m = 50.0) {
  return {random.NextUniform(-reach_m, reach_m),
          random.NextUniform(-reach_m, reach_m),
          WrapAngle(random.NextUniform(-kPi, kPi))};
}

void ExpectNear(const Pose2& a, const Pose2& b, double tolerance = 1e-11) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(WrapAngle(a.theta - b.theta), 0.0, tolerance);
}

TEST(Se2Test, MotionsAreAGroup) {
  RandomSequence random(1);
  for (int i = 0; i < kRounds; ++i) {
    const Pose2 a = RandomPose(random);
    const Pose2 b = RandomPose(random);
    const Pose2 c = RandomPose(random);
    ExpectNear((a * b) * c, a * (b * c));
    ExpectNear(a * Pose2(), a, 0.0);
    ExpectNear(Pose2() * a, a, 0.0);
    ExpectNear(a * Inverse(a), {});
    ExpectNear(Inverse(a) * a, {});
    ExpectNear(Inverse(a * b), Inverse(b) * Inverse(a));
  }
}

TEST(Se2Test, MotionsActOnPointsOneAfterTheOther) {
  RandomSequence random(2);
  for (int i = 0; i < kRounds; ++i) {
    const Pose2 a = RandomPose(random);
    const Pose2 b = RandomPose(random);
    const Eigen::Vector2d point(random.NextNormal(), random.NextNormal());
    EXPECT_LT(((a * b) * point - a * (b * point)).norm(), 1e-11);
    EXPECT_EQ(Transformer2(a) * point, a * point);
    EXPECT_LT((Transformer2(a).Rotate(point) - (a * point - a.translation())).norm(), 1e-11);
  }
}

TEST(Se2Test, ThetaStaysInItsInterval) {
  RandomSequence random(3);
  for (int i = 0; i < kRounds; ++i) {
    const Pose2 product = RandomPose(random) * RandomPose(random);
    EXPECT_GT(product.theta, -kPi);
    EXPECT_LE(product.theta, kPi);
  }
  EXPECT_EQ(Inverse(Pose2{0.0, 0.0, kPi}).theta, kPi);
}

TEST(Se2Test, LogUndoesExp) {
  RandomSequence random(4);
  for (int i = 0; i < kRounds; ++i) {
    const Eigen::Vector3d xi(random.NextUniform(-10.0, 10.0),
                             random.NextUniform(-10.0, 10.0),
                             random.NextUniform(-3.1, 3.1));
    EXPECT_LT((Log(Exp(xi)) - xi).norm(), 1e-10);
    const Pose2 pose = RandomPose(random);
    ExpectNear(Exp(Log(pose)), pose, 1e-10);
  }
}

TEST(Se2Test, LogUndoesExpAtSmallAnglesAndAtPi) {
  for (const double theta :
       {0.0, 1e-300, 1e-12, 9.9e-5, 1e-4, 1.1e-4, 1e-3, -1e-4, 3.1415926, kPi}) {
    const Eigen::Vector3d xi(3.0, -2.0, theta);
    EXPECT_LT((Log(Exp(xi)) - xi).norm(), 1e-10) << theta;
  }
}

TEST(Se2Test, ExpOfATwistIsManySmallSteps) {
  const Eigen::Vector3d xi(1.0, 0.3, 1.2);
  Pose2 stepped;
  constexpr int kSteps = 1 << 14;
  for (int i = 0; i < kSteps; ++i) {
    stepped = stepped * Exp(xi / kSteps);
  }
  ExpectNear(stepped, Exp(xi), 1e-9);
}

TEST(Se2Test, TheAdjointCarriesAPerturbationFromTheRightToTheLeft) {
  RandomSequence random(5);
  for (int i = 0; i < kRounds; ++i) {
    const Pose2 pose = RandomPose(random, 5.0);
    const Eigen::Vector3d xi(
        random.NextNormal(), random.NextNormal(), random.NextUniform(-0.5, 0.5));
    ExpectNear(pose * Exp(xi), Exp(Adjoint(pose) * xi) * pose, 1e-10);
  }
}

TEST(Se2Test, TheAdjointOfAProductIsTheProductOfTheAdjoints) {
  RandomSequence random(6);
  for (int i = 0; i < kRounds; ++i) {
    const Pose2 a = RandomPose(random);
    const Pose2 b = RandomPose(random);
    EXPECT_LT((Adjoint(a * b) - Adjoint(a) * Adjoint(b)).norm(), 1e-10);
    EXPECT_LT((Adjoint(a) * Adjoint(Inverse(a)) - Eigen::Matrix3d::Identity()).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace loci
