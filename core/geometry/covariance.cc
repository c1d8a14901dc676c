// SPDX-License-Identifier: Apache-2.0
#include "core/geometry/covariance.h"

#include <string>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace loci {
namespace {

Eigen::Matrix3d Symmetrized(const Eigen::Matrix3d& matrix) {
  return 0.5 * (matrix + matrix.transpose());
}

}  // namespace

StatusOr<Covariance3> Covariance3::FromMatrix(const Eigen::Matrix3d& matrix,
                                              std::string_view field) {
  const std::string name(field);
  if (!matrix.allFinite()) {
    return InvalidArgumentError(name + ": not a finite number");
  }
  const double scale = matrix.cwiseAbs().maxCoeff();
  if ((matrix - matrix.transpose()).cwiseAbs().maxCoeff() > 1e-9 * scale) {
    return InvalidArgumentError(name + ": not symmetric");
  }
  const Eigen::Matrix3d symmetric = Symmetrized(matrix);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(symmetric, Eigen::EigenvaluesOnly);
  const double smallest = solver.eigenvalues().x();
  if (!(smallest > 0.0)) {
    return InvalidArgumentError(name + ": eigenvalue " + std::to_string(smallest) +
                                ", must be > 0");
  }
  return Covariance3(symmetric);
}

Covariance3 Covariance3::FromSigmas(double sigma_x_m, double sigma_y_m, double sigma_theta_rad) {
  LOCI_CHECK(sigma_x_m > 0.0 && sigma_y_m > 0.0 && sigma_theta_rad > 0.0);
  const Eigen::Vector3d sigmas(sigma_x_m, sigma_y_m, sigma_theta_rad);
  return Covariance3(sigmas.cwiseAbs2().asDiagonal());
}

Eigen::Matrix3d Covariance3::Information() const {
  return Symmetrized(matrix_.inverse());
}

Eigen::Matrix3d InformationOf(const Eigen::Matrix3d& covariance,
                              double sigma_min_m,
                              double sigma_min_rad) {
  constexpr double kRatioMax = 1e10;  // of variances
  const Eigen::Vector3d scale(1.0 / sigma_min_m, 1.0 / sigma_min_m, 1.0 / sigma_min_rad);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scale.asDiagonal() * covariance *
                                                              scale.asDiagonal());
  const Eigen::Vector3d& values = solver.eigenvalues();
  if (values.minCoeff() >= 1.0 && values.maxCoeff() <= kRatioMax) {
    return Symmetrized(covariance.inverse());
  }
  const Eigen::Matrix3d information =
      solver.eigenvectors() * values.cwiseMax(1.0).cwiseMin(kRatioMax).cwiseInverse().asDiagonal() *
      solver.eigenvectors().transpose();
  return Symmetrized(scale.asDiagonal() * information * scale.asDiagonal());
}

Eigen::Matrix3d SymmetricFromUpper(const std::array<double, 6>& upper) {
  const auto [xx, xy, xt, yy, yt, tt] = upper;
  Eigen::Matrix3d matrix;
  matrix << xx, xy, xt, xy, yy, yt, xt, yt, tt;
  return matrix;
}

Covariance3 Compound(const Covariance3& a_from_b_covariance,
                     const Pose2& b_from_c,
                     const Covariance3& b_from_c_covariance) {
  const Eigen::Matrix3d adjoint = Adjoint(Inverse(b_from_c));
  const Eigen::Matrix3d sum =
      adjoint * a_from_b_covariance.matrix() * adjoint.transpose() + b_from_c_covariance.matrix();
  StatusOr<Covariance3> compounded = Covariance3::FromMatrix(Symmetrized(sum), "compounded");
  LOCI_CHECK(compounded.ok());
  return *compounded;
}

Covariance3 InverseCovariance(const Pose2& a_from_b, const Covariance3& covariance) {
  const Eigen::Matrix3d adjoint = Adjoint(a_from_b);
  StatusOr<Covariance3> inverse = Covariance3::FromMatrix(
      Symmetrized(adjoint * covariance.matrix() * adjoint.transpose()), "inverse");
  LOCI_CHECK(inverse.ok());
  return *inverse;
}

}  // namespace loci
