// SPDX-License-Identifier: Apache-2.0
#include "core/mesh/barycentric.h"

#include <algorithm>
#include <cmath>

namespace loci {

Affine2 MapFromUv(const TriangleInMap& triangle) {
  const auto& corners = triangle.corners_in_map;
  return {corners[0], corners[1] - corners[0], corners[2] - corners[0]};
}

TriangleShape ShapeOf(const TriangleInMap& triangle) {
  const Affine2 map_from_uv = MapFromUv(triangle);
  return {map_from_uv.x_axis.dot(map_from_uv.x_axis),
          map_from_uv.x_axis.dot(map_from_uv.y_axis),
          map_from_uv.y_axis.dot(map_from_uv.y_axis)};
}

Stretch StretchBetween(const TriangleShape& before, const TriangleShape& now) {
  // With G the matrices of inner products, the squared singular values are the eigenvalues of
  // G_before^-1 G_now: roots of l^2 - trace l + determinant.
  const double area_before = before.Determinant();
  const double trace =
      (before.vv * now.uu - 2.0 * before.uv * now.uv + before.uu * now.vv) / area_before;
  const double determinant = std::max(0.0, now.Determinant()) / area_before;
  const double half = 0.5 * trace;
  const double root = std::sqrt(std::max(0.0, half * half - determinant));
  const double largest = half + root;
  // The product of the roots is the determinant; half - root would lose digits.
  const double smallest = largest > 0.0 ? determinant / largest : 0.0;
  return {std::sqrt(std::max(0.0, smallest)), std::sqrt(std::max(0.0, largest))};
}

double SmallestAngleSineSquared(const TriangleShape& shape) {
  // The smallest angle lies between the two longest edges; its sine is 2 area / their product.
  const double third = shape.uu - 2.0 * shape.uv + shape.vv;
  const double shortest = std::min({shape.uu, shape.vv, third});
  double product = 0.0;
  if (shortest == third) {
    product = shape.uu * shape.vv;
  } else if (shortest == shape.uu) {
    product = shape.vv * third;
  } else {
    product = shape.uu * third;
  }
  return product > 0.0 ? std::max(0.0, shape.Determinant()) / product : 0.0;
}

}  // namespace loci
