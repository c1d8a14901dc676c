// SPDX-License-Identifier: Apache-2.0
#include "core/mesh/delaunay.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

using Corners = Triangulation::Corners;

std::vector<Corners> CornersOf(const Triangulation& mesh) {
  std::vector<Corners> corners;
  for (const Triangulation::Triangle& triangle : mesh.triangles()) {
    corners.push_back(triangle.corners);
  }
  return corners;
}

std::vector<SnappedPoint> PointsOf(const Triangulation& mesh) {
  std::vector<SnappedPoint> points;
  for (CornerIndex i = 0; i < mesh.point_count(); ++i) {
    points.push_back(mesh.PointAt(i + Triangulation::kSuperCount));
  }
  return points;
}

// Twice the area, exact.
Int128 AreaOf(const Triangulation& mesh, const Corners& corners) {
  const SnappedPoint a = mesh.PointAt(corners[0]);
  const SnappedPoint b = mesh.PointAt(corners[1]);
  const SnappedPoint c = mesh.PointAt(corners[2]);
  return static_cast<Int128>(std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - a.y) -
         static_cast<Int128>(std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - a.x);
}

// Checks everything in the slow and plain way.
void ExpectTriangulation(const Triangulation& mesh) {
  Int128 area = 0;
  for (TriangleIndex t = 0; t < mesh.triangles().size(); ++t) {
    const Triangulation::Triangle& triangle = mesh.triangles()[t];
    const Int128 own = AreaOf(mesh, triangle.corners);
    ASSERT_TRUE(own > 0) << "triangle " << t;
    area += own;
    for (std::size_t side = 0; side < 3; ++side) {
      const TriangleIndex neighbour = triangle.neighbours[side];
      if (neighbour == Triangulation::kNone) {
        continue;
      }
      const auto& back = mesh.triangles()[neighbour].neighbours;
      ASSERT_EQ(std::count(back.begin(), back.end(), t), 1);
    }
  }
  ASSERT_TRUE(area == AreaOf(mesh, {0, 1, 2}));  // no hole and no overlap
  // What was stored is read back.
  StatusOr<Triangulation> copy = Triangulation::FromTriangles(PointsOf(mesh), CornersOf(mesh));
  ASSERT_TRUE(copy.ok()) << copy.status().ToString();
  for (TriangleIndex t = 0; t < mesh.triangles().size(); ++t) {
    ASSERT_EQ(copy->triangles()[t].neighbours, mesh.triangles()[t].neighbours);
  }
}

void ExpectDelaunay(const Triangulation& mesh) {
  for (const Triangulation::Triangle& triangle : mesh.triangles()) {
    for (CornerIndex point = 0; point < mesh.point_count() + 3; ++point) {
      ASSERT_LE(InCircle(mesh.PointAt(triangle.corners[0]),
                         mesh.PointAt(triangle.corners[1]),
                         mesh.PointAt(triangle.corners[2]),
                         mesh.PointAt(point)),
                0);
    }
  }
}

SnappedPoint RandomPoint(RandomSequence& random, double half_side_m) {
  return Snap(Eigen::Vector2d(random.NextUniform(-half_side_m, half_side_m),
                              random.NextUniform(-half_side_m, half_side_m)));
}

TEST(DelaunayTest, RandomPointsGiveADelaunayTriangulation) {
  RandomSequence random(11);
  for (const double half_side_m : {0.001, 1.0, 100.0, 32000.0}) {
    Triangulation mesh;
    for (int i = 0; i < 120; ++i) {
      mesh.Insert(RandomPoint(random, half_side_m));
    }
    ExpectTriangulation(mesh);
    ExpectDelaunay(mesh);
  }
}

TEST(DelaunayTest, CocircularLatticesAndPointsOnEdgesAreHandledExactly) {
  Triangulation mesh;
  for (int y = -4; y <= 4; ++y) {
    for (int x = -4; x <= 4; ++x) {
      EXPECT_TRUE(mesh.Insert(Snap(Eigen::Vector2d(8.0 * x, 8.0 * y))));
    }
  }
  for (int x = -7; x <= 7; ++x) {
    mesh.Insert(Snap(Eigen::Vector2d(4.0 * x, 4.0)));  // on edges, some on vertices
  }
  ExpectTriangulation(mesh);
  ExpectDelaunay(mesh);
}

TEST(DelaunayTest, APointAtThePlaceOfAnotherIsInNoTriangle) {
  Triangulation mesh;
  EXPECT_TRUE(mesh.Insert({5, 5}));
  EXPECT_TRUE(mesh.Insert({900, 5}));
  EXPECT_FALSE(mesh.Insert({5, 5}));
  EXPECT_TRUE(mesh.Insert({5, 900}));
  EXPECT_EQ(mesh.point_count(), 4U);
  for (const Corners& corners : CornersOf(mesh)) {
    EXPECT_EQ(std::count(corners.begin(), corners.end(), 5U), 0);
  }
  ExpectTriangulation(mesh);
  ExpectDelaunay(mesh);
  // Once it has moved away, a rebuilt mesh has it.
  std::vector<SnappedPoint> points = PointsOf(mesh);
  points[2] = {400, 300};
  mesh.MovePoints(points);
  mesh.Rebuild();
  ExpectTriangulation(mesh);
  EXPECT_EQ(mesh.triangles().size(), 2U * 4U + 1U);
}

TEST(DelaunayTest, LocateFindsATriangleThatContainsThePoint) {
  RandomSequence random(12);
  Triangulation mesh;
  for (int i = 0; i < 300; ++i) {
    mesh.Insert(RandomPoint(random, 50.0));
  }
  TriangleIndex hint = 0;
  for (int i = 0; i < 2000; ++i) {
    const SnappedPoint point = RandomPoint(random, 60.0);
    hint = mesh.Locate(point, hint);
    const Corners& corners = mesh.triangles()[hint].corners;
    for (std::size_t side = 0; side < 3; ++side) {
      ASSERT_GE(
          Orientation(mesh.PointAt(corners[side]), mesh.PointAt(corners[(side + 1) % 3]), point),
          0);
    }
  }
}

TEST(DelaunayTest, StaysATriangulationThroughRandomInsertionsAndMoves) {
  RandomSequence random(13);
  for (int round = 0; round < 6; ++round) {
    Triangulation mesh;
    for (int step = 0; step < 700; ++step) {
      if (step % 7 != 6) {
        // A small coordinate range makes lines, circles and coincidences common.
        const SnappedPoint point = {static_cast<std::int32_t>(random.NextBits() % 64) * 3,
                                    static_cast<std::int32_t>(random.NextBits() % 64) * 3};
        if (mesh.point_count() < 100) {
          mesh.Insert(point);
        }
      } else {
        std::vector<SnappedPoint> points = PointsOf(mesh);
        for (SnappedPoint& point : points) {
          if (random.NextBits() % 8 == 0) {
            point.x += static_cast<std::int32_t>(random.NextBits() % 7) - 3;
            point.y += static_cast<std::int32_t>(random.NextBits() % 7) - 3;
          }
        }
        mesh.MovePoints(points);
        if (!mesh.valid()) {
          mesh.Rebuild();
        }
      }
      ASSERT_TRUE(mesh.valid());
      if (step % 25 == 0) {
        ExpectTriangulation(mesh);
      }
    }
    ExpectTriangulation(mesh);
  }
}

TEST(DelaunayTest, FlippingToImproveEndsWithADelaunayTriangulationInside) {
  RandomSequence random(14);
  Triangulation mesh;
  for (int i = 0; i < 80; ++i) {
    mesh.Insert(RandomPoint(random, 50.0));
  }
  std::vector<SnappedPoint> points = PointsOf(mesh);
  std::vector<SnappedPoint> moved = points;
  // The largest random motion that turns nothing over.
  for (double scale_m = 8.0; scale_m > 0.01; scale_m *= 0.7) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const SnappedPoint shift = RandomPoint(random, scale_m);
      moved[i] = {points[i].x + shift.x, points[i].y + shift.y};
    }
    mesh.MovePoints(moved);
    if (mesh.valid()) {
      break;
    }
  }
  ASSERT_TRUE(mesh.valid());
  int flips = 0;
  for (TriangleIndex t = 0; t < mesh.triangles().size();) {
    if (mesh.FlipToImprove(t)) {
      ASSERT_LT(++flips, 10000);
      t = 0;
    } else {
      ++t;
    }
  }
  ExpectTriangulation(mesh);
  for (TriangleIndex t = 0; t < mesh.triangles().size(); ++t) {
    EXPECT_FALSE(mesh.CanImprove(t));
  }
}

TEST(DelaunayTest, ARebuiltLatticeKeepsItsTriangles) {
  RandomSequence random(15);
  Triangulation mesh;
  std::vector<SnappedPoint> points;
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 10; ++x) {
      points.push_back(Snap(Eigen::Vector2d(8.0 * x, 8.0 * y)));
      mesh.Insert(points.back());
    }
  }
  const auto real_triples = [](const Triangulation& triangulation) {
    std::set<Corners> triples;
    for (TriangleIndex t = 0; t < triangulation.triangles().size(); ++t) {
      Corners corners = triangulation.triangles()[t].corners;
      std::sort(corners.begin(), corners.end());
      if (triangulation.IsReal(t)) {
        triples.insert(corners);
      }
    }
    return triples;
  };
  const std::set<Corners> before = real_triples(mesh);
  for (SnappedPoint& point : points) {  // a centimetre: diagonals are a matter of taste
    const SnappedPoint shift = RandomPoint(random, 0.01);
    point = {point.x + shift.x, point.y + shift.y};
  }
  mesh.MovePoints(points);
  mesh.Rebuild();
  ExpectTriangulation(mesh);
  const std::set<Corners> after = real_triples(mesh);
  std::size_t kept = 0;
  for (const Corners& corners : before) {
    kept += after.count(corners);
  }
  // Triangles along the border may change: the hull of the moved points is another one.
  EXPECT_GE(kept, before.size() * 95 / 100) << "of " << before.size();
}

TEST(DelaunayTest, RefusesTrianglesThatDoNotFitTogether) {
  RandomSequence random(16);
  Triangulation mesh;
  for (int i = 0; i < 30; ++i) {
    mesh.Insert(RandomPoint(random, 50.0));
  }
  const std::vector<SnappedPoint> points = PointsOf(mesh);
  ASSERT_TRUE(Triangulation::FromTriangles(points, CornersOf(mesh)).ok());
  for (int round = 0; round < 500; ++round) {
    std::vector<Corners> corners = CornersOf(mesh);
    const std::size_t at = random.NextBits() % corners.size();
    const std::size_t side = random.NextBits() % 3;
    const CornerIndex before = corners[at][side];
    corners[at][side] = static_cast<CornerIndex>(random.NextBits() % 40);
    if (corners[at][side] != before) {
      EXPECT_EQ(Triangulation::FromTriangles(points, corners).status().code(),
                StatusCode::kDataLoss);
    }
  }
  std::vector<Corners> short_list = CornersOf(mesh);
  short_list.pop_back();
  EXPECT_FALSE(Triangulation::FromTriangles(points, short_list).ok());
  EXPECT_FALSE(Triangulation::FromTriangles(points, {}).ok());
}

}  // namespace
}  // namespace loci
