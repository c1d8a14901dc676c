// SPDX-License-Identifier: Apache-2.0
#include "core/geometry/covariance.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "core/base/random.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

Covariance3 RandomCovariance(RandomSequence& random, double sigma) {
  Eigen::Matrix3d factor;
  for (Eigen::Index i = 0; i < factor.size(); ++i) {
    factor.data()[i] = sigma * random.NextNormal();
  }
  const Eigen::Matrix3d matrix =
      factor * factor.transpose() + 0.01 * sigma * sigma * Eigen::Matrix3d::Identity();
  return *Covariance3::FromMatrix(0.5 * (matrix + matrix.transpose()), "random");
}

Eigen::Vector3d Draw(const Eigen::Matrix3d& factor, RandomSequence& random) {
  const Eigen::Vector3d normal(random.NextNormal(), random.NextNormal(), random.NextNormal());
  return factor * normal;
}

Eigen::Matrix3d FactorOf(const Covariance3& covariance) {
  return Eigen::LLT<Eigen::Matrix3d>(covariance.matrix()).matrixL();
}

TEST(CovarianceTest, WhatIsNoCovarianceIsRefusedByName) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  EXPECT_THAT(Covariance3::FromMatrix(matrix, "c"), IsOk());
  matrix(0, 1) = 0.5;
  EXPECT_THAT(Covariance3::FromMatrix(matrix, "scan.c"),
              IsStatus(StatusCode::kInvalidArgument, "scan.c: not symmetric"));
  matrix(1, 0) = 0.5;
  EXPECT_THAT(Covariance3::FromMatrix(matrix, "c"), IsOk());
  matrix(0, 1) = matrix(1, 0) = 2.0;
  EXPECT_THAT(Covariance3::FromMatrix(matrix, "c"),
              IsStatus(StatusCode::kInvalidArgument, "c: eigenvalue -1"));
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    matrix = Eigen::Matrix3d::Identity();
    matrix(2, 2) = bad;
    EXPECT_THAT(Covariance3::FromMatrix(matrix, "c"),
                IsStatus(StatusCode::kInvalidArgument, "c: not a finite number"));
  }
  EXPECT_THAT(Covariance3::FromMatrix(Eigen::Matrix3d::Zero(), "c"),
              IsStatus(StatusCode::kInvalidArgument, "c: eigenvalue 0"));
}

TEST(CovarianceTest, AlmostSymmetricBecomesSymmetric) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(0, 1) = 0.3 + 5e-10;
  matrix(1, 0) = 0.3;
  const StatusOr<Covariance3> covariance = Covariance3::FromMatrix(matrix, "c");
  ASSERT_THAT(covariance, IsOk());
  EXPECT_EQ(covariance->matrix(), covariance->matrix().transpose());
}

TEST(CovarianceTest, InformationIsTheInverse) {
  RandomSequence random(1);
  for (int i = 0; i < 500; ++i) {
    const Covariance3 covariance = RandomCovariance(random, 0.1);
    EXPECT_LT((covariance.Information() * covariance.matrix() - Eigen::Matrix3d::Identity()).norm(),
              1e-8);
    EXPECT_EQ(covariance.Information(), covariance.Information().transpose());
  }
}

TEST(CovarianceTest, TheUpperTriangleIsReadRowByRow) {
  const Eigen::Matrix3d matrix = SymmetricFromUpper({1, 2, 3, 4, 5, 6});
  Eigen::Matrix3d expected;
  expected << 1, 2, 3, 2, 4, 5, 3, 5, 6;
  EXPECT_EQ(matrix, expected);
}

// The mean of Log(result^-1 * disturbed result) squared, over many disturbances.
template <typename Disturbed>
Eigen::Matrix3d Sampled(const Pose2& result, Disturbed disturbed) {
  constexpr int kCount = 40000;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int i = 0; i < kCount; ++i) {
    const Eigen::Vector3d difference = Log(Inverse(result) * disturbed());
    sum += difference * difference.transpose();
  }
  return sum / kCount;
}

TEST(CovarianceTest, CompoundAgreesWithSampling) {
  RandomSequence random(2);
  for (int round = 0; round < 3; ++round) {
    const Pose2 a_from_b{random.NextNormal(), random.NextNormal(), random.NextUniform(-3.0, 3.0)};
    const Pose2 b_from_c{random.NextNormal(), random.NextNormal(), random.NextUniform(-3.0, 3.0)};
    const Covariance3 first = RandomCovariance(random, 0.01);
    const Covariance3 second = RandomCovariance(random, 0.01);
    const Eigen::Matrix3d first_factor = FactorOf(first);
    const Eigen::Matrix3d second_factor = FactorOf(second);
    const Eigen::Matrix3d sampled = Sampled(a_from_b * b_from_c, [&] {
      return a_from_b * Exp(Draw(first_factor, random)) * b_from_c *
             Exp(Draw(second_factor, random));
    });
    const Eigen::Matrix3d computed = Compound(first, b_from_c, second).matrix();
    EXPECT_LT((sampled - computed).norm(), 0.05 * computed.norm());
  }
}

TEST(CovarianceTest, InverseCovarianceAgreesWithSampling) {
  RandomSequence random(3);
  const Pose2 a_from_b{1.0, -2.0, 0.8};
  const Covariance3 covariance = RandomCovariance(random, 0.01);
  const Eigen::Matrix3d factor = FactorOf(covariance);
  const Eigen::Matrix3d sampled =
      Sampled(Inverse(a_from_b), [&] { return Inverse(a_from_b * Exp(Draw(factor, random))); });
  const Eigen::Matrix3d computed = InverseCovariance(a_from_b, covariance).matrix();
  EXPECT_LT((sampled - computed).norm(), 0.05 * computed.norm());
}

TEST(CovarianceTest, InvertingTwiceAndCompoundingInAnyOrderChangeNothing) {
  RandomSequence random(4);
  for (int i = 0; i < 200; ++i) {
    const Pose2 a_from_b{random.NextNormal(), random.NextNormal(), random.NextUniform(-3.0, 3.0)};
    const Pose2 b_from_c{random.NextNormal(), random.NextNormal(), random.NextUniform(-3.0, 3.0)};
    const Pose2 c_from_d{random.NextNormal(), random.NextNormal(), random.NextUniform(-3.0, 3.0)};
    const Covariance3 ab = RandomCovariance(random, 0.1);
    const Covariance3 bc = RandomCovariance(random, 0.1);
    const Covariance3 cd = RandomCovariance(random, 0.1);
    const Covariance3 twice = InverseCovariance(Inverse(a_from_b), InverseCovariance(a_from_b, ab));
    EXPECT_LT((twice.matrix() - ab.matrix()).norm(), 1e-9 * ab.matrix().norm() + 1e-12);
    const Covariance3 left = Compound(Compound(ab, b_from_c, bc), c_from_d, cd);
    const Covariance3 right = Compound(ab, b_from_c * c_from_d, Compound(bc, c_from_d, cd));
    EXPECT_LT((left.matrix() - right.matrix()).norm(), 1e-9 * left.matrix().norm());
  }
}

double LeastEigenvalue(const Eigen::Matrix3d& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(matrix).eigenvalues().minCoeff();
}

TEST(CovarianceTest, NothingCountsAsKnownBetterThanTheLeastDoubt) {
  const Covariance3 good = Covariance3::FromSigmas(0.1, 0.2, 0.01);
  EXPECT_EQ(InformationOf(good.matrix(), 0.1, 0.01), good.Information());
  const Eigen::Matrix3d mixed =
      InformationOf(Covariance3::FromSigmas(1e-7, 0.2, 1e-6).matrix(), 1e-3, 1e-4);
  EXPECT_NEAR(mixed(0, 0), 1e6, 1e-3);
  EXPECT_NEAR(mixed(1, 1), 25.0, 1e-6);
  EXPECT_NEAR(mixed(2, 2), 1e8, 1e-1);
  RandomSequence random(5);
  for (int i = 0; i < 200; ++i) {
    const Covariance3 before = RandomCovariance(random, 1e-3);
    const Eigen::Matrix3d after = InformationOf(before.matrix(), 1e-3, 1e-3);
    EXPECT_GE(LeastEigenvalue(before.Information() - after), -1e-9 * after.norm());
    EXPECT_LE(after.norm(), 3e6);
  }
}

TEST(CovarianceTest, TheInformationOfDoubtsThatRoundingSpoilsCanBeSolved) {
  // A robot that turned it knows not how far, and then drove a long way: what the eigenvalues have
  // in digits is more than a double has.
  for (const double step_m : {5.0, 50.0, 1000.0}) {
    for (const double variance_rad2 : {1.0, 1e4, 1e6}) {
      for (int i = 0; i < 100; ++i) {
        const double direction = 0.0628 * i;
        Eigen::Matrix3d turned = Eigen::Vector3d(1e-14, 1e-14, variance_rad2).asDiagonal();
        const Pose2 step{step_m * std::cos(direction), step_m * std::sin(direction), 0.3};
        const Eigen::Matrix3d adjoint = Adjoint(Inverse(step));
        turned = adjoint * turned * adjoint.transpose() + 1e-14 * Eigen::Matrix3d::Identity();
        const Eigen::Matrix3d information =
            InformationOf(0.5 * (turned + turned.transpose()), 1e-3, 1e-4);
        const Eigen::DiagonalMatrix<double, 3> sigmas(1e-3, 1e-3, 1e-4);
        const Eigen::Matrix3d scaled = sigmas * information * sigmas;
        EXPECT_GE(LeastEigenvalue(scaled), 0.99e-10);
        EXPECT_GE(LeastEigenvalue(-scaled), -1.01);
      }
    }
  }
}

}  // namespace
}  // namespace loci
