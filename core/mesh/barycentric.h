// SPDX-License-Identifier: Apache-2.0
// Points of a local triangular region (LTR), and the shape of a triangle.
#pragma once

#include <array>

#include <Eigen/Core>

#include "core/geometry/affine.h"

namespace loci {

// Corners of one triangle, in metres in the frame `map`.
struct TriangleInMap {
  std::array<Eigen::Vector2d, 3> corners_in_map;
};

// (u, v) -> point in map (HYMM, equation 2): p = L_i + u (L_j - L_i) + v (L_k - L_i). Inside of the
// triangle: u >= 0, v >= 0, u + v <= 1.
Affine2 MapFromUv(const TriangleInMap& triangle);

// Shape of a triangle, up to rotation and translation: the inner products of its edges
// e_u = second - first corner and e_v = third - first corner, in square metres.
struct TriangleShape {
  double uu = 0.0;
  double uv = 0.0;
  double vv = 0.0;

  // Square of twice the area.
  double Determinant() const { return uu * vv - uv * uv; }
};

TriangleShape ShapeOf(const TriangleInMap& triangle);

// How a triangle was bent: factors by which lengths grew, at most and at least, over all
// directions.
struct Stretch {
  double smallest = 1.0;
  double largest = 1.0;
};

// The singular values of the affine map that takes a triangle of shape `before` to one of shape
// `now`. `before` must have an area.
Stretch StretchBetween(const TriangleShape& before, const TriangleShape& now);

// Square of the sine of the smallest angle; 0 for a triangle without area.
double SmallestAngleSineSquared(const TriangleShape& shape);

}  // namespace loci
