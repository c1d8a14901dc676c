// SPDX-License-Identifier: Apache-2.0
// Rigid motions of the plane, SE(2).
#pragma once

#include <Eigen/Core>

#include "core/base/math.h"
#include "core/geometry/angle.h"

namespace loci {

// The pose of a frame b in a frame a: `a_from_b`. Metres and radians; theta in (-pi, pi].
struct Pose2 {
  double x = 0.0;
  double y = 0.0;
  double theta = 0.0;

  Eigen::Vector2d translation() const { return {x, y}; }
  Eigen::Vector3d vector() const { return {x, y, theta}; }
  friend bool operator==(const Pose2&, const Pose2&) = default;
};

template <typename Archive>
void Fields(Archive& archive, Pose2& pose) {
  archive(pose.x, pose.y, pose.theta);
}

// a_from_c = a_from_b * b_from_c.
Pose2 operator*(const Pose2& a_from_b, const Pose2& b_from_c);

// point_in_a = a_from_b * point_in_b.
Eigen::Vector2d operator*(const Pose2& a_from_b, const Eigen::Vector2d& point_in_b);

// b_from_a.
Pose2 Inverse(const Pose2& a_from_b);

// The motion of the exponential map: xi = (x, y, theta) in the tangent space at the identity.
Pose2 Exp(const Eigen::Vector3d& xi);
// Inverse of Exp, theta in (-pi, pi].
Eigen::Vector3d Log(const Pose2& pose);

// Adjoint: a_from_b * Exp(xi) == Exp(Adjoint(a_from_b) * xi) * a_from_b.
Eigen::Matrix3d Adjoint(const Pose2& a_from_b);

// A pose with its sine and cosine at hand, for applying it to many points.
class Transformer2 {
 public:
  explicit Transformer2(const Pose2& a_from_b)
      : x_(a_from_b.x), y_(a_from_b.y), cosine_(Cos(a_from_b.theta)), sine_(Sin(a_from_b.theta)) {}

  Eigen::Vector2d operator*(const Eigen::Vector2d& point_in_b) const {
    return {x_ + cosine_ * point_in_b.x() - sine_ * point_in_b.y(),
            y_ + sine_ * point_in_b.x() + cosine_ * point_in_b.y()};
  }
  Eigen::Vector2d Rotate(const Eigen::Vector2d& direction_in_b) const {
    return {cosine_ * direction_in_b.x() - sine_ * direction_in_b.y(),
            sine_ * direction_in_b.x() + cosine_ * direction_in_b.y()};
  }

 private:
  double x_;
  double y_;
  double cosine_;
  double sine_;
};

}  // namespace loci
