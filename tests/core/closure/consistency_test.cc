// SPDX-License-Identifier: Apache-2.0
#include "core/closure/consistency.h"

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/covariance.h"

namespace loci {
namespace {

UncertainPose2 RandomUncertain(RandomSequence& random) {
  const Eigen::Matrix3d base = Covariance3::FromSigmas(random.NextUniform(0.01, 0.3),
                                                       random.NextUniform(0.01, 0.3),
                                                       random.NextUniform(0.005, 0.05))
                                   .matrix();
  const Eigen::Matrix3d turn = Adjoint({0.0, 0.0, random.NextUniform(-3.0, 3.0)});
  const Eigen::Matrix3d turned = turn * base * turn.transpose();
  return {{random.NextNormal(), random.NextNormal(), random.NextUniform(-3.0, 3.0)},
          0.5 * (turned + turned.transpose())};
}

TEST(ConsistencyTest, ComposingIsAssociativeAndAgreesWithCompound) {
  RandomSequence random(1);
  for (int i = 0; i < 300; ++i) {
    const UncertainPose2 a = RandomUncertain(random);
    const UncertainPose2 b = RandomUncertain(random);
    const UncertainPose2 c = RandomUncertain(random);
    const UncertainPose2 left = Compose(Compose(a, b), c);
    const UncertainPose2 right = Compose(a, Compose(b, c));
    EXPECT_LT((left.covariance - right.covariance).norm(), 1e-12);
    const Covariance3 compounded = Compound(*Covariance3::FromMatrix(a.covariance, "a"),
                                            b.pose,
                                            *Covariance3::FromMatrix(b.covariance, "b"));
    EXPECT_LT((Compose(a, b).covariance - compounded.matrix()).norm(), 1e-12);
  }
}

TEST(ConsistencyTest, Chi2IsZeroOnlyForTheSamePoseAndDoesNotDependOnTheFrame) {
  RandomSequence random(2);
  for (int i = 0; i < 300; ++i) {
    const UncertainPose2 a = RandomUncertain(random);
    UncertainPose2 b = RandomUncertain(random);
    EXPECT_NEAR(Chi2Between(a, {a.pose, b.covariance}), 0.0, 1e-12);
    b.pose = a.pose * Exp(0.1 * Eigen::Vector3d(random.NextNormal(), random.NextNormal(), 0.3));
    const double chi2 = Chi2Between(a, b);
    EXPECT_GT(chi2, 0.0);
    const Pose2 frame{random.NextNormal(), random.NextNormal(), random.NextUniform(-3.0, 3.0)};
    EXPECT_NEAR(Chi2Between({frame * a.pose, a.covariance}, {frame * b.pose, b.covariance}),
                chi2,
                1e-9 * (1.0 + chi2));
  }
}

TEST(ConsistencyTest, Chi2OfSamplesHasThreeDegreesOfFreedom) {
  RandomSequence random(4);
  const Covariance3 covariance = Covariance3::FromSigmas(0.05, 0.02, 0.01);
  const Pose2 pose{1.0, 2.0, 0.5};
  const auto draw = [&]() -> UncertainPose2 {
    const Eigen::Vector3d xi(
        0.05 * random.NextNormal(), 0.02 * random.NextNormal(), 0.01 * random.NextNormal());
    return {pose * Exp(xi), covariance.matrix()};
  };
  constexpr int kCount = 20000;
  double sum = 0.0;
  int beyond = 0;
  for (int i = 0; i < kCount; ++i) {
    const double chi2 = Chi2Between(draw(), draw());
    sum += chi2;
    beyond += chi2 > kChi2At99 ? 1 : 0;
  }
  EXPECT_NEAR(sum / kCount, 3.0, 0.1);
  EXPECT_NEAR(beyond / static_cast<double>(kCount), 0.01, 0.004);
}

}  // namespace
}  // namespace loci
