// SPDX-License-Identifier: Apache-2.0
// The topology of the mesh: a triangulation that is Delaunay where it was built and is kept while
// its points move, until they turn a triangle over.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/status.h"
#include "core/mesh/snapped_point.h"

namespace loci {

// Index of a point in a triangulation. 0, 1, 2 are the super vertices: far corners that hold
// everything, so that every point of the map lies in a triangle and a hull is nothing special.
// They stand 34 km and more outside: the hull of the real triangles may miss slivers of the convex
// hull as thin as (edge length)^2 / 130 km.
using CornerIndex = std::uint32_t;
using TriangleIndex = std::uint32_t;

// Invariants: the triangles tile the super triangle (as a topology; as a picture only while
// valid()); each has its corners counter-clockwise at the time it was made; a point at the same
// position as an earlier one is in no triangle. Deterministic: the order of triangles and of their
// corners depends only on the calls made. All geometry is exact.
class Triangulation {
 public:
  static constexpr CornerIndex kSuperCount = 3;
  static constexpr TriangleIndex kNone = 0xFFFFFFFFU;

  using Corners = std::array<CornerIndex, 3>;

  struct Triangle {
    Corners corners;
    std::array<TriangleIndex, 3> neighbours;  // neighbours[i] lies opposite corners[i]
  };

  Triangulation();

  // A triangulation with points (without the super vertices) and triangles as they were stored.
  // kDataLoss if the triangles do not tile the super triangle as a topology.
  static StatusOr<Triangulation> FromTriangles(std::vector<SnappedPoint> points,
                                               const std::vector<Corners>& triangles);

  // Adds a point by splitting the triangle under it and flipping edges around it until they are
  // Delaunay as seen from it. False if a point was there already: it then is in no triangle.
  // Needs valid().
  bool Insert(const SnappedPoint& point);

  // New positions of all points, super vertices left out. Touches no triangle.
  void MovePoints(std::span<const SnappedPoint> points);

  // No triangle is turned over or without area.
  bool valid() const { return valid_; }

  // Makes a new Delaunay triangulation of the points where they are now. Then takes back edges of
  // the old one where both diagonals do, so that triangles survive that need not go.
  void Rebuild();

  // A triangle that contains the point (border included). Needs valid(). `hint` saves time.
  TriangleIndex Locate(const SnappedPoint& point, TriangleIndex hint) const;

  // Flips an edge of the triangle that is not Delaunay and lies between real triangles; false if
  // there is none. Each flip takes the mesh nearer to the Delaunay triangulation of the points
  // where they are, so flipping comes to an end. Needs valid().
  bool FlipToImprove(TriangleIndex triangle);
  bool CanImprove(TriangleIndex triangle) const;

  const std::vector<Triangle>& triangles() const { return triangles_; }
  bool IsReal(TriangleIndex triangle) const;
  const SnappedPoint& PointAt(CornerIndex corner) const { return points_[corner]; }
  std::size_t point_count() const { return points_.size() - kSuperCount; }

 private:
  int OrientationOf(const Triangle& triangle) const;
  bool FindNeighbours();
  bool IsConnected() const;
  void SplitInside(TriangleIndex triangle, CornerIndex corner);
  void SplitEdge(TriangleIndex triangle, std::size_t side, CornerIndex corner);
  void Legalise(CornerIndex corner, std::vector<TriangleIndex>& open);
  void Flip(TriangleIndex triangle, std::size_t side);
  void SetNeighbour(TriangleIndex triangle, TriangleIndex before, TriangleIndex now);
  std::optional<std::size_t> SideToImprove(TriangleIndex triangle) const;
  void TakeBackEdges(const std::vector<std::pair<CornerIndex, CornerIndex>>& old_edges);
  bool TakeBackEdgesOf(TriangleIndex triangle,
                       const std::vector<std::pair<CornerIndex, CornerIndex>>& old_edges);
  bool FlipIsFair(TriangleIndex triangle, std::size_t side) const;

  std::vector<SnappedPoint> points_;  // super vertices first
  std::vector<Triangle> triangles_;
  bool valid_ = true;
};

}  // namespace loci
