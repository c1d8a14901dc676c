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

}  // namespace loci
