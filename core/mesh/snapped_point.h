// SPDX-License-Identifier: Apache-2.0
// Points of the map on a grid fine enough to hide and coarse enough for exact geometry.
#pragma once

#include <cmath>
#include <cstdint>

#include <Eigen/Core>

namespace loci {

// One unit is 2^-14 m (61 micrometres).
inline constexpr double kUnitsPerMetre = 16384.0;
// Coordinates of points of the map lie strictly within +-2^29 units (32.7 km).
inline constexpr std::int32_t kSnappedLimit = 1 << 29;

struct SnappedPoint {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend bool operator==(const SnappedPoint&, const SnappedPoint&) = default;
};

// The nearest snapped point; coordinates beyond the limit are held at it, NaN becomes 0.
inline SnappedPoint Snap(const Eigen::Vector2d& point_in_map) {
  const auto snap = [](double metres) {
    const double limit = static_cast<double>(kSnappedLimit - 1);
    const double units = std::floor(metres * kUnitsPerMetre + 0.5);
    if (!(units > -limit)) {
      return units <= -limit ? -(kSnappedLimit - 1) : 0;
    }
    return units < limit ? static_cast<std::int32_t>(units) : kSnappedLimit - 1;
  };
  return {snap(point_in_map.x()), snap(point_in_map.y())};
}

inline Eigen::Vector2d ToMetres(const SnappedPoint& point) {  // exact
  return {point.x / kUnitsPerMetre, point.y / kUnitsPerMetre};
}

__extension__ using Int128 = __int128;

// Above 0 if a, b, c turn left, below if right, 0 if they lie on one line. Exact.
inline int Orientation(const SnappedPoint& a, const SnappedPoint& b, const SnappedPoint& c) {
  const std::int64_t bx = std::int64_t{b.x} - a.x;
  const std::int64_t by = std::int64_t{b.y} - a.y;
  const std::int64_t cx = std::int64_t{c.x} - a.x;
  const std::int64_t cy = std::int64_t{c.y} - a.y;
  const Int128 turn = static_cast<Int128>(bx) * cy - static_cast<Int128>(by) * cx;
  return turn > 0 ? 1 : (turn < 0 ? -1 : 0);
}

// Above 0 if d lies inside the circle through a, b, c (counter-clockwise), below if outside, 0 on
// the circle. Exact.
//
// Bound: no two points of a triangulation are further apart than L = 4.56 * 2^29 units (its super
// vertices), and the sum is at most 2.6 L^4 < 2^127: three crossings sum to twice the area of a
// triangle in a circle of radius L, and each is weighted by at most L^2.
inline int InCircle(const SnappedPoint& a,
                    const SnappedPoint& b,
                    const SnappedPoint& c,
                    const SnappedPoint& d) {
  const std::int64_t ax = std::int64_t{a.x} - d.x;
  const std::int64_t ay = std::int64_t{a.y} - d.y;
  const std::int64_t bx = std::int64_t{b.x} - d.x;
  const std::int64_t by = std::int64_t{b.y} - d.y;
  const std::int64_t cx = std::int64_t{c.x} - d.x;
  const std::int64_t cy = std::int64_t{c.y} - d.y;
  const auto product = [](std::int64_t left, std::int64_t right) {
    return static_cast<Int128>(left) * right;
  };
  const Int128 lift_a = product(ax, ax) + product(ay, ay);
  const Int128 lift_b = product(bx, bx) + product(by, by);
  const Int128 lift_c = product(cx, cx) + product(cy, cy);
  const Int128 inside = lift_a * (product(bx, cy) - product(by, cx)) +
                        lift_b * (product(cx, ay) - product(cy, ax)) +
                        lift_c * (product(ax, by) - product(ay, bx));
  return inside > 0 ? 1 : (inside < 0 ? -1 : 0);
}

}  // namespace loci
