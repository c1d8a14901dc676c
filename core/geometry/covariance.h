// SPDX-License-Identifier: Apache-2.0
// Covariance of a pose in the plane.
#pragma once

#include <array>
#include <string_view>

#include <Eigen/Core>

#include "core/base/status.h"
#include "core/geometry/se2.h"

namespace loci {

// Symmetric positive definite 3 x 3 matrix in the order (x, y, theta), in m^2, m rad and rad^2.
//
// It belongs to a pose a_from_b and describes a perturbation on its right: a_from_b * Exp(xi), so
// x and y lie along the axes of b. Invariant: symmetric, every eigenvalue above 0.
class Covariance3 {
 public:
  // Checks that `matrix` is finite, symmetric (to 1e-9 of its largest entry; it is then made so
  // exactly) and positive definite. `field` names it in the error, kInvalidArgument.
  static StatusOr<Covariance3> FromMatrix(const Eigen::Matrix3d& matrix, std::string_view field);
  static Covariance3 FromSigmas(double sigma_x_m, double sigma_y_m, double sigma_theta_rad);

  const Eigen::Matrix3d& matrix() const { return matrix_; }
  // The inverse, symmetric.
  Eigen::Matrix3d Information() const;

 private:
  explicit Covariance3(const Eigen::Matrix3d& matrix) : matrix_(matrix) {}
  Eigen::Matrix3d matrix_;
};

// The inverse of a covariance, where nothing counts as known better than an ellipse of these half
// axes, nor worse than one that is 1e5 times as large: what is then tied to each other can be
// solved in double precision. `covariance` is symmetric; it may have been positive definite before
// it was rounded. The inverse is symmetric and positive definite.
Eigen::Matrix3d InformationOf(const Eigen::Matrix3d& covariance,
                              double sigma_min_m,
                              double sigma_min_rad);

// The symmetric matrix whose upper triangle, row by row, is given.
Eigen::Matrix3d SymmetricFromUpper(const std::array<double, 6>& upper);

// Covariance of a_from_c = a_from_b * b_from_c with independent errors, to first order.
Covariance3 Compound(const Covariance3& a_from_b_covariance,
                     const Pose2& b_from_c,
                     const Covariance3& b_from_c_covariance);

// Covariance of Inverse(a_from_b).
Covariance3 InverseCovariance(const Pose2& a_from_b, const Covariance3& covariance);

}  // namespace loci
