// SPDX-License-Identifier: Apache-2.0
// Rigid motions of space, SE(3).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace loci {

// The pose of a frame b in a frame a: `a_from_b`. Metres; a unit quaternion.
struct Pose3 {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
};

// a_from_c = a_from_b * b_from_c, with the quaternion normalised again.
inline Pose3 operator*(const Pose3& a_from_b, const Pose3& b_from_c) {
  return {a_from_b.translation + a_from_b.rotation * b_from_c.translation,
          (a_from_b.rotation * b_from_c.rotation).normalized()};
}

// b_from_a.
inline Pose3 Inverse(const Pose3& a_from_b) {
  const Eigen::Quaterniond rotation = a_from_b.rotation.conjugate();
  return {-(rotation * a_from_b.translation), rotation};
}

// Adjoint, for xi = (translation, rotation vector): to first order in xi,
// a_from_b * Exp(xi) == Exp(Adjoint(a_from_b) * xi) * a_from_b.
inline Eigen::Matrix<double, 6, 6> Adjoint(const Pose3& a_from_b) {
  const Eigen::Matrix3d rotation = a_from_b.rotation.toRotationMatrix();
  const Eigen::Vector3d& t = a_from_b.translation;
  Eigen::Matrix3d cross;
  cross << 0.0, -t.z(), t.y(), t.z(), 0.0, -t.x(), -t.y(), t.x(), 0.0;
  Eigen::Matrix<double, 6, 6> adjoint = Eigen::Matrix<double, 6, 6>::Zero();
  adjoint.topLeftCorner<3, 3>() = rotation;
  adjoint.topRightCorner<3, 3>() = cross * rotation;
  adjoint.bottomRightCorner<3, 3>() = rotation;
  return adjoint;
}

}  // namespace loci
