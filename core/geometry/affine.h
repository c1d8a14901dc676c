// SPDX-License-Identifier: Apache-2.0
// Affine maps of the plane.
#pragma once

#include <Eigen/Core>

namespace loci {

// point -> origin + point.x * x_axis + point.y * y_axis. Arithmetic in a fixed order.
struct Affine2 {
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  Eigen::Vector2d x_axis = Eigen::Vector2d::UnitX();
  Eigen::Vector2d y_axis = Eigen::Vector2d::UnitY();

  Eigen::Vector2d operator*(const Eigen::Vector2d& point) const {
    return {origin.x() + point.x() * x_axis.x() + point.y() * y_axis.x(),
            origin.y() + point.x() * x_axis.y() + point.y() * y_axis.y()};
  }
  Eigen::Vector2d Linear(const Eigen::Vector2d& direction) const {
    return {direction.x() * x_axis.x() + direction.y() * y_axis.x(),
            direction.x() * x_axis.y() + direction.y() * y_axis.y()};
  }
  double Determinant() const { return x_axis.x() * y_axis.y() - y_axis.x() * x_axis.y(); }
};

// First `right`, then `left`.
inline Affine2 operator*(const Affine2& left, const Affine2& right) {
  return {left * right.origin, left.Linear(right.x_axis), left.Linear(right.y_axis)};
}

// The determinant must not be 0.
inline Affine2 Inverse(const Affine2& map) {
  const double scale = 1.0 / map.Determinant();
  Affine2 inverse;
  inverse.x_axis = Eigen::Vector2d(map.y_axis.y() * scale, -map.x_axis.y() * scale);
  inverse.y_axis = Eigen::Vector2d(-map.y_axis.x() * scale, map.x_axis.x() * scale);
  inverse.origin = Eigen::Vector2d::Zero() - inverse.Linear(map.origin);
  return inverse;
}

// The same with its argument scaled first: (x, y) -> map * (x * x_scale, y * y_scale).
inline Affine2 ScaleArgument(const Affine2& map, double x_scale, double y_scale) {
  return {map.origin, map.x_axis * x_scale, map.y_axis * y_scale};
}

}  // namespace loci
