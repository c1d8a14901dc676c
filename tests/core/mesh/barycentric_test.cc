// SPDX-License-Identifier: Apache-2.0
#include "core/mesh/barycentric.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/se2.h"

namespace loci {
namespace {

TriangleInMap RandomTriangle(RandomSequence& random) {
  while (true) {
    TriangleInMap triangle;
    for (Eigen::Vector2d& corner : triangle.corners_in_map) {
      corner = {random.NextUniform(-50.0, 50.0), random.NextUniform(-50.0, 50.0)};
    }
    if (MapFromUv(triangle).Determinant() > 1.0) {
      return triangle;
    }
  }
}

TEST(BarycentricTest, CornersAreThoseOfTheUnitSimplex) {
  RandomSequence random(1);
  const TriangleInMap triangle = RandomTriangle(random);
  const Affine2 map_from_uv = MapFromUv(triangle);
  EXPECT_LT((map_from_uv * Eigen::Vector2d(0, 0) - triangle.corners_in_map[0]).norm(), 1e-12);
  EXPECT_LT((map_from_uv * Eigen::Vector2d(1, 0) - triangle.corners_in_map[1]).norm(), 1e-12);
  EXPECT_LT((map_from_uv * Eigen::Vector2d(0, 1) - triangle.corners_in_map[2]).norm(), 1e-12);
}

TEST(BarycentricTest, APointFollowsItsTriangleInARigidMotion) {
  RandomSequence random(2);
  for (int round = 0; round < 1000; ++round) {
    const TriangleInMap triangle = RandomTriangle(random);
    const Pose2 motion{random.NextUniform(-9.0, 9.0),
                       random.NextUniform(-9.0, 9.0),
                       random.NextUniform(-3.0, 3.0)};
    TriangleInMap moved = triangle;
    for (Eigen::Vector2d& corner : moved.corners_in_map) {
      corner = motion * corner;
    }
    const Eigen::Vector2d uv(random.NextUniform(-1.0, 2.0), random.NextUniform(-1.0, 2.0));
    const Eigen::Vector2d followed = motion * (MapFromUv(triangle) * uv);
    EXPECT_LT((MapFromUv(moved) * uv - followed).norm(), 1e-10);
  }
}

TEST(TriangleShapeTest, StretchIsOneForARigidMotionAndTheFactorForAScaling) {
  RandomSequence random(3);
  for (int round = 0; round < 200; ++round) {
    const TriangleInMap triangle = RandomTriangle(random);
    const Pose2 motion{1.0, 2.0, random.NextUniform(-3.0, 3.0)};
    const double x_scale = random.NextUniform(0.5, 1.0);
    const double y_scale = random.NextUniform(1.0, 2.0);
    TriangleInMap moved = triangle;
    TriangleInMap scaled = triangle;
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector2d corner = triangle.corners_in_map[i];
      moved.corners_in_map[i] = motion * corner;
      scaled.corners_in_map[i] =
          motion * Eigen::Vector2d(corner.x() * x_scale, corner.y() * y_scale);
    }
    const Stretch rigid = StretchBetween(ShapeOf(triangle), ShapeOf(moved));
    EXPECT_NEAR(rigid.smallest, 1.0, 1e-5);  // a double root: half the digits
    EXPECT_NEAR(rigid.largest, 1.0, 1e-5);
    const Stretch stretch = StretchBetween(ShapeOf(triangle), ShapeOf(scaled));
    EXPECT_NEAR(stretch.smallest, x_scale, 1e-6);
    EXPECT_NEAR(stretch.largest, y_scale, 1e-6);
  }
}

TEST(TriangleShapeTest, TheSmallestAngleIsFound) {
  RandomSequence random(4);
  for (int round = 0; round < 200; ++round) {
    const TriangleInMap triangle = RandomTriangle(random);
    double smallest = kPi;
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector2d a = triangle.corners_in_map[(i + 1) % 3] - triangle.corners_in_map[i];
      const Eigen::Vector2d b = triangle.corners_in_map[(i + 2) % 3] - triangle.corners_in_map[i];
      smallest = std::min(smallest, std::acos(a.dot(b) / (a.norm() * b.norm())));
    }
    EXPECT_NEAR(SmallestAngleSineSquared(ShapeOf(triangle)), std::pow(std::sin(smallest), 2), 1e-9);
  }
}

}  // namespace
}  // namespace loci
