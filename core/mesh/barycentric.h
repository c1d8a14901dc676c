// SPDX-License-Identifier: Apache-2.0
// Coordinates of a point inside a local triangular region (LTR), and the shape of a triangle.
#pragma once

#include <array>

#include <Eigen/Core>

#include "core/base/status.h"
#include "core/geometry/affine.h"

namespace loci {

// Corners of one triangle, in metres in the frame `map`.
struct TriangleInMap {
  std::array<Eigen::Vector2d, 3> corners_in_map;
};

// Weights of the second and third corner; the first has 1 - u - v. No unit.
// Inside the triangle: u >= 0, v >= 0, u + v <= 1.
struct BarycentricUv {
  double u = 0.0;
  double v = 0.0;
};

// (u, v) -> point in map (HYMM, equation 2): p = L_i + u (L_j - L_i) + v (L_k - L_i).
Affine2 MapFromUv(const TriangleInMap& triangle);

// Returns the coordinates of `point_in_map` relative to `triangle` (HYMM, equation 2, solved for u
// and v).
//
// Law: moving triangle and point by one affine motion leaves (u, v) as they were.
// Points outside the triangle get coordinates outside the unit simplex; that is no error.
// Errors: kInvalidArgument if the area is below `area_min_m2` or the corners run clockwise.
StatusOr<BarycentricUv> ToBarycentric(const TriangleInMap& triangle,
                                      const Eigen::Vector2d& point_in_map,
                                      double area_min_m2);

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
