// SPDX-License-Identifier: Apache-2.0
// Whether two loop closures tell the same story: test 5 of a loop closure (design.md, 4.9).
#pragma once

#include <Eigen/Core>

#include "core/geometry/se2.h"

namespace loci {

// 99 % of a chi2 distribution with three degrees of freedom.
inline constexpr double kChi2At99 = 11.345;
// 99.9 %, and the square of 3 sigma's probability in three dimensions (99.73 %).
inline constexpr double kChi2At999 = 16.266;
inline constexpr double kChi2At3Sigma = 14.156;

// A relative pose a_from_b and its covariance, (x, y, theta), right perturbation.
struct UncertainPose2 {
  Pose2 pose;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

// a_from_c = a_from_b * b_from_c with independent errors, to first order.
UncertainPose2 Compose(const UncertainPose2& a_from_b, const UncertainPose2& b_from_c);

// Squared Mahalanobis distance between two independent estimates of the same relative pose.
double Chi2Between(const UncertainPose2& a, const UncertainPose2& b);

}  // namespace loci
