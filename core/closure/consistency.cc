// SPDX-License-Identifier: Apache-2.0
#include "core/closure/consistency.h"

#include <Eigen/Cholesky>

namespace loci {

UncertainPose2 Compose(const UncertainPose2& a_from_b, const UncertainPose2& b_from_c) {
  const Eigen::Matrix3d adjoint = Adjoint(Inverse(b_from_c.pose));
  const Eigen::Matrix3d sum =
      adjoint * a_from_b.covariance * adjoint.transpose() + b_from_c.covariance;
  return {a_from_b.pose * b_from_c.pose, 0.5 * (sum + sum.transpose())};
}

double Chi2Between(const UncertainPose2& a, const UncertainPose2& b) {
  const Eigen::Vector3d difference = Log(Inverse(a.pose) * b.pose);
  // b's perturbation is carried to a's frame; the two lie close together, so the turn between them
  // is small, but it costs nothing to take it along.
  const Eigen::Matrix3d adjoint = Adjoint(Inverse(a.pose) * b.pose);
  const Eigen::Matrix3d sum = a.covariance + adjoint * b.covariance * adjoint.transpose();
  const Eigen::Matrix3d symmetric = 0.5 * (sum + sum.transpose());
  return difference.dot(symmetric.ldlt().solve(difference));
}

}  // namespace loci
