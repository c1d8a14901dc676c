// SPDX-License-Identifier: Apache-2.0
#include "core/geometry/se2.h"

#include <cmath>

namespace loci {
namespace {

// Below this angle the closed forms lose digits and the series are exact to double: theta^4 / 120
// is under 1e-18.
constexpr double kSmallAngleRad = 1e-4;

// sin(theta) / theta and (1 - cos(theta)) / theta.
struct ExpCoefficients {
  double sine_part;
  double cosine_part;
};

ExpCoefficients CoefficientsOf(double theta) {
  if (std::abs(theta) < kSmallAngleRad) {
    return {1.0 - theta * theta / 6.0, theta / 2.0 - theta * theta * theta / 24.0};
  }
  return {Sin(theta) / theta, (1.0 - Cos(theta)) / theta};
}

}  // namespace

Pose2 operator*(const Pose2& a_from_b, const Pose2& b_from_c) {
  const Eigen::Vector2d translation = a_from_b * b_from_c.translation();
  return {translation.x(), translation.y(), WrapAngle(a_from_b.theta + b_from_c.theta)};
}

Eigen::Vector2d operator*(const Pose2& a_from_b, const Eigen::Vector2d& point_in_b) {
  return Transformer2(a_from_b) * point_in_b;
}

Pose2 Inverse(const Pose2& a_from_b) {
  const double cosine = Cos(a_from_b.theta);
  const double sine = Sin(a_from_b.theta);
  return {-cosine * a_from_b.x - sine * a_from_b.y,
          sine * a_from_b.x - cosine * a_from_b.y,
          WrapAngle(-a_from_b.theta)};
}

Pose2 Exp(const Eigen::Vector3d& xi) {
  const auto [s, c] = CoefficientsOf(xi.z());
  return {s * xi.x() - c * xi.y(), c * xi.x() + s * xi.y(), WrapAngle(xi.z())};
}

Eigen::Vector3d Log(const Pose2& pose) {
  const auto [s, c] = CoefficientsOf(pose.theta);
  const double determinant = s * s + c * c;
  return {(s * pose.x + c * pose.y) / determinant,
          (-c * pose.x + s * pose.y) / determinant,
          pose.theta};
}

Eigen::Matrix3d Adjoint(const Pose2& a_from_b) {
  const double cosine = Cos(a_from_b.theta);
  const double sine = Sin(a_from_b.theta);
  Eigen::Matrix3d adjoint;
  adjoint << cosine, -sine, a_from_b.y, sine, cosine, -a_from_b.x, 0.0, 0.0, 1.0;
  return adjoint;
}

}  // namespace loci
