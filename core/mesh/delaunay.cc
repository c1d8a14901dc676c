// SPDX-License-Identifier: Apache-2.0
#include "core/mesh/delaunay.h"

#include <algorithm>
#include <utility>

#include "core/base/check.h"
#include "core/base/random.h"
#include "core/mesh/barycentric.h"

namespace loci {
namespace {

using Edge = std::pair<CornerIndex, CornerIndex>;

constexpr std::size_t Next(std::size_t side) {
  return side == 2 ? 0 : side + 1;
}
constexpr std::size_t Previous(std::size_t side) {
  return side == 0 ? 2 : side - 1;
}

Edge Unordered(CornerIndex a, CornerIndex b) {
  return a < b ? Edge(a, b) : Edge(b, a);
}

// Corners of a triangle that contains the square of all points of the map, (-2.25, -1.05),
// (2.25, -1.05), (0, 2.9) times the square's half side; the distances meet the bound of InCircle.
std::vector<SnappedPoint> SuperVertices() {
  constexpr std::int32_t kTwentieth = kSnappedLimit / 20;
  return {{-45 * kTwentieth, -21 * kTwentieth - 20},
          {45 * kTwentieth, -21 * kTwentieth - 20},
          {0, 58 * kTwentieth}};
}

std::size_t SideOf(const Triangulation::Triangle& triangle, TriangleIndex neighbour) {
  for (std::size_t side = 0; side < 3; ++side) {
    if (triangle.neighbours[side] == neighbour) {
      return side;
    }
  }
  LOCI_CHECK(false && "neighbours do not know each other");
}

}  // namespace

Triangulation::Triangulation()
    : points_(SuperVertices()), triangles_{{{0, 1, 2}, {kNone, kNone, kNone}}} {}

StatusOr<Triangulation> Triangulation::FromTriangles(std::vector<SnappedPoint> points,
                                                     const std::vector<Corners>& triangles) {
  Triangulation result;
  result.points_.insert(result.points_.end(), points.begin(), points.end());
  result.triangles_.clear();
  std::vector<bool> used(result.points_.size(), false);
  for (const Corners& corners : triangles) {
    for (const CornerIndex corner : corners) {
      if (corner >= result.points_.size()) {
        return DataLossError("mesh: triangle with corner " + std::to_string(corner) +
                             ", there are " + std::to_string(result.points_.size()));
      }
      used[corner] = true;
    }
    result.triangles_.push_back({corners, {kNone, kNone, kNone}});
  }
  // A connected surface with one border whose Euler characteristic is 1 is a disc.
  const auto used_count = static_cast<std::size_t>(std::count(used.begin(), used.end(), true));
  if (!used[0] || triangles.size() + 5 != 2 * used_count || !result.FindNeighbours() ||
      !result.IsConnected()) {
    return DataLossError("mesh: its triangles do not fit together");
  }
  result.MovePoints(points);
  return result;
}

bool Triangulation::FindNeighbours() {
  struct DirectedEdge {
    CornerIndex from;
    CornerIndex to;
    TriangleIndex triangle;
    std::size_t side;
    bool operator<(const DirectedEdge& other) const {
      return Edge(from, to) < Edge(other.from, other.to);
    }
  };
  std::vector<DirectedEdge> edges;
  edges.reserve(triangles_.size() * 3);
  for (TriangleIndex t = 0; t < triangles_.size(); ++t) {
    for (std::size_t side = 0; side < 3; ++side) {
      const Corners& corners = triangles_[t].corners;
      edges.push_back({corners[Next(side)], corners[Previous(side)], t, side});
    }
  }
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const DirectedEdge& edge = edges[i];
    if (edge.from == edge.to || (i > 0 && !(edges[i - 1] < edge))) {
      return false;
    }
    const bool is_border = edge.from < kSuperCount && edge.to == (edge.from + 1) % kSuperCount;
    const DirectedEdge twin{edge.to, edge.from, 0, 0};
    const auto found = std::lower_bound(edges.begin(), edges.end(), twin);
    const bool has_twin = found != edges.end() && !(twin < *found);
    if (has_twin == is_border) {
      return false;
    }
    triangles_[edge.triangle].neighbours[edge.side] = has_twin ? found->triangle : kNone;
  }
  return true;
}

bool Triangulation::IsConnected() const {
  std::vector<bool> reached(triangles_.size(), false);
  std::vector<TriangleIndex> open = {0};
  reached[0] = true;
  std::size_t count = 1;
  while (!open.empty()) {
    const Triangle& triangle = triangles_[open.back()];
    open.pop_back();
    for (const TriangleIndex neighbour : triangle.neighbours) {
      if (neighbour != kNone && !reached[neighbour]) {
        reached[neighbour] = true;
        open.push_back(neighbour);
        ++count;
      }
    }
  }
  return count == triangles_.size();
}

int Triangulation::OrientationOf(const Triangle& triangle) const {
  return Orientation(
      points_[triangle.corners[0]], points_[triangle.corners[1]], points_[triangle.corners[2]]);
}

bool Triangulation::IsReal(TriangleIndex triangle) const {
  const Corners& corners = triangles_[triangle].corners;
  return corners[0] >= kSuperCount && corners[1] >= kSuperCount && corners[2] >= kSuperCount;
}

void Triangulation::MovePoints(std::span<const SnappedPoint> points) {
  LOCI_CHECK(points.size() == point_count());
  std::copy(points.begin(), points.end(), points_.begin() + kSuperCount);
  valid_ = std::all_of(triangles_.begin(), triangles_.end(), [this](const Triangle& triangle) {
    return OrientationOf(triangle) > 0;
  });
}

TriangleIndex Triangulation::Locate(const SnappedPoint& point, TriangleIndex hint) const {
  LOCI_CHECK(valid_);
  const auto contains = [&](TriangleIndex t, std::size_t side) {
    const Corners& corners = triangles_[t].corners;
    return Orientation(points_[corners[Next(side)]], points_[corners[Previous(side)]], point) >= 0;
  };
  // The walk crosses any edge that has the point on its far side. Where the triangulation is no
  // longer Delaunay a walk could run in circles; varying the edge that is looked at first ends
  // that.
  TriangleIndex at = hint < triangles_.size() ? hint : 0;
  for (std::size_t step = 0; step < 64 + 4 * triangles_.size(); ++step) {
    const std::size_t first = MixBits(step) % 3;
    bool inside = true;
    for (const std::size_t side : {first, Next(first), Previous(first)}) {
      if (!contains(at, side)) {
        at = triangles_[at].neighbours[side];
        inside = false;
        break;
      }
    }
    if (inside) {
      return at;
    }
    LOCI_CHECK(at != kNone);  // points of the map lie inside the super triangle
  }
  for (at = 0; at < triangles_.size(); ++at) {
    if (contains(at, 0) && contains(at, 1) && contains(at, 2)) {
      return at;
    }
  }
  LOCI_CHECK(false && "a valid triangulation has no holes");
}

bool Triangulation::Insert(const SnappedPoint& point) {
  // From the newest triangle, never from one that was looked up last: that would be hidden state.
  const TriangleIndex triangle = Locate(point, static_cast<TriangleIndex>(triangles_.size() - 1));
  const Corners corners = triangles_[triangle].corners;
  const auto corner = static_cast<CornerIndex>(points_.size());
  points_.push_back(point);
  for (const CornerIndex other : corners) {
    if (points_[other] == point) {
      return false;
    }
  }
  for (std::size_t side = 0; side < 3; ++side) {
    if (Orientation(points_[corners[Next(side)]], points_[corners[Previous(side)]], point) == 0) {
      SplitEdge(triangle, side, corner);
      return true;
    }
  }
  SplitInside(triangle, corner);
  return true;
}

void Triangulation::SplitInside(TriangleIndex triangle, CornerIndex corner) {
  const auto [a, b, c] = triangles_[triangle].corners;
  const auto [beyond_a, beyond_b, beyond_c] = triangles_[triangle].neighbours;
  const TriangleIndex t0 = triangle;
  const auto t1 = static_cast<TriangleIndex>(triangles_.size());
  const TriangleIndex t2 = t1 + 1;
  triangles_[t0] = {{a, b, corner}, {t1, t2, beyond_c}};
  triangles_.push_back({{b, c, corner}, {t2, t0, beyond_a}});
  triangles_.push_back({{c, a, corner}, {t0, t1, beyond_b}});
  SetNeighbour(beyond_a, t0, t1);
  SetNeighbour(beyond_b, t0, t2);
  std::vector<TriangleIndex> open = {t0, t1, t2};
  Legalise(corner, open);
}

void Triangulation::SplitEdge(TriangleIndex triangle, std::size_t side, CornerIndex corner) {
  const Triangle upper = triangles_[triangle];
  const TriangleIndex t0 = triangle;
  const TriangleIndex t2 = upper.neighbours[side];
  LOCI_CHECK(t2 != kNone);  // points of the map do not lie on the border of the super triangle
  const Triangle lower = triangles_[t2];
  const std::size_t lower_side = SideOf(lower, t0);
  const auto t1 = static_cast<TriangleIndex>(triangles_.size());
  const TriangleIndex t3 = t1 + 1;
  // The edge runs from a to b, with c on its left and d on its right.
  const CornerIndex c = upper.corners[side];
  const CornerIndex a = upper.corners[Next(side)];
  const CornerIndex b = upper.corners[Previous(side)];
  const CornerIndex d = lower.corners[lower_side];
  const TriangleIndex beyond_bc = upper.neighbours[Next(side)];
  const TriangleIndex beyond_ca = upper.neighbours[Previous(side)];
  const TriangleIndex beyond_ad = lower.neighbours[Next(lower_side)];
  const TriangleIndex beyond_db = lower.neighbours[Previous(lower_side)];
  triangles_[t0] = {{c, a, corner}, {t3, t1, beyond_ca}};
  triangles_[t2] = {{d, b, corner}, {t1, t3, beyond_db}};
  triangles_.push_back({{c, corner, b}, {t2, beyond_bc, t0}});
  triangles_.push_back({{d, corner, a}, {t0, beyond_ad, t2}});
  SetNeighbour(beyond_bc, t0, t1);
  SetNeighbour(beyond_ad, t2, t3);
  std::vector<TriangleIndex> open = {t0, t1, t2, t3};
  Legalise(corner, open);
}

void Triangulation::SetNeighbour(TriangleIndex triangle, TriangleIndex before, TriangleIndex now) {
  if (triangle != kNone) {
    triangles_[triangle].neighbours[SideOf(triangles_[triangle], before)] = now;
  }
}

// Lawson's flips around a new point. Every flip adds an edge to it, so they come to an end also
// where the triangles around were not Delaunay.
void Triangulation::Legalise(CornerIndex corner, std::vector<TriangleIndex>& open) {
  while (!open.empty()) {
    const TriangleIndex t = open.back();
    open.pop_back();
    const Corners& corners = triangles_[t].corners;
    const auto side = static_cast<std::size_t>(std::find(corners.begin(), corners.end(), corner) -
                                               corners.begin());
    const TriangleIndex neighbour = triangles_[t].neighbours[side];
    if (neighbour == kNone) {
      continue;
    }
    const Triangle& beyond = triangles_[neighbour];
    const CornerIndex apex = beyond.corners[SideOf(beyond, t)];
    if (InCircle(points_[corners[0]], points_[corners[1]], points_[corners[2]], points_[apex]) >
        0) {
      Flip(t, side);
      open.push_back(neighbour);
      open.push_back(t);
    }
  }
}

void Triangulation::Flip(TriangleIndex triangle, std::size_t side) {
  const Triangle left = triangles_[triangle];
  const TriangleIndex other = left.neighbours[side];
  const Triangle right = triangles_[other];
  const std::size_t right_side = SideOf(right, triangle);
  const CornerIndex p = left.corners[side];
  const CornerIndex a = left.corners[Next(side)];
  const CornerIndex b = left.corners[Previous(side)];
  const CornerIndex d = right.corners[right_side];
  const TriangleIndex beyond_bp = left.neighbours[Next(side)];
  const TriangleIndex beyond_pa = left.neighbours[Previous(side)];
  const TriangleIndex beyond_ad = right.neighbours[Next(right_side)];
  const TriangleIndex beyond_db = right.neighbours[Previous(right_side)];
  triangles_[triangle] = {{p, a, d}, {beyond_ad, other, beyond_pa}};
  triangles_[other] = {{p, d, b}, {beyond_db, beyond_bp, triangle}};
  SetNeighbour(beyond_ad, other, triangle);
  SetNeighbour(beyond_bp, triangle, other);
}

std::optional<std::size_t> Triangulation::SideToImprove(TriangleIndex triangle) const {
  if (!IsReal(triangle)) {
    return std::nullopt;
  }
  const Triangle& here = triangles_[triangle];
  for (std::size_t side = 0; side < 3; ++side) {
    const TriangleIndex neighbour = here.neighbours[side];
    if (neighbour == kNone || !IsReal(neighbour)) {
      continue;
    }
    const Triangle& beyond = triangles_[neighbour];
    const CornerIndex apex = beyond.corners[SideOf(beyond, triangle)];
    if (InCircle(points_[here.corners[0]],
                 points_[here.corners[1]],
                 points_[here.corners[2]],
                 points_[apex]) > 0) {
      return side;
    }
  }
  return std::nullopt;
}

bool Triangulation::CanImprove(TriangleIndex triangle) const {
  return valid_ && SideToImprove(triangle).has_value();
}

bool Triangulation::FlipToImprove(TriangleIndex triangle) {
  LOCI_CHECK(valid_);
  // With the far corner inside the circle the two triangles form a strictly convex quadrangle.
  const std::optional<std::size_t> side = SideToImprove(triangle);
  if (side.has_value()) {
    Flip(triangle, *side);
  }
  return side.has_value();
}

void Triangulation::Rebuild() {
  std::vector<Edge> old_edges;
  for (TriangleIndex t = 0; t < triangles_.size(); ++t) {
    const Corners& corners = triangles_[t].corners;
    if (IsReal(t)) {
      for (std::size_t side = 0; side < 3; ++side) {
        old_edges.push_back(Unordered(corners[side], corners[Next(side)]));
      }
    }
  }
  std::sort(old_edges.begin(), old_edges.end());
  const std::vector<SnappedPoint> points(points_.begin() + kSuperCount, points_.end());
  *this = Triangulation();
  for (const SnappedPoint& point : points) {
    Insert(point);
  }
  TakeBackEdges(old_edges);
}

// Every flip brings an old edge back and takes none away, so this comes to an end.
void Triangulation::TakeBackEdges(const std::vector<Edge>& old_edges) {
  bool changed = true;
  while (changed) {
    changed = false;
    for (TriangleIndex t = 0; t < triangles_.size(); ++t) {
      changed = TakeBackEdgesOf(t, old_edges) || changed;
    }
  }
}

bool Triangulation::TakeBackEdgesOf(TriangleIndex triangle, const std::vector<Edge>& old_edges) {
  const auto is_old = [&](CornerIndex a, CornerIndex b) {
    return std::binary_search(old_edges.begin(), old_edges.end(), Unordered(a, b));
  };
  bool changed = false;
  for (std::size_t side = 0; side < 3 && IsReal(triangle); ++side) {
    const Triangle& here = triangles_[triangle];
    const TriangleIndex neighbour = here.neighbours[side];
    if (neighbour == kNone || !IsReal(neighbour) ||
        is_old(here.corners[Next(side)], here.corners[Previous(side)])) {
      continue;
    }
    const Triangle& beyond = triangles_[neighbour];
    if (is_old(here.corners[side], beyond.corners[SideOf(beyond, triangle)]) &&
        FlipIsFair(triangle, side)) {
      Flip(triangle, side);
      changed = true;
    }
  }
  return changed;
}

bool Triangulation::FlipIsFair(TriangleIndex triangle, std::size_t side) const {
  // 20 degrees: above the 15 below which an LTR is remeshed, so that a small move does not undo it.
  constexpr double kSineSquaredMin = 0.116977778;
  const Triangle& here = triangles_[triangle];
  const Triangle& beyond = triangles_[here.neighbours[side]];
  const CornerIndex p = here.corners[side];
  const CornerIndex d = beyond.corners[SideOf(beyond, triangle)];
  const std::array<Corners, 2> after = {Corners{p, here.corners[Next(side)], d},
                                        Corners{p, d, here.corners[Previous(side)]}};
  return std::all_of(after.begin(), after.end(), [this](const Corners& corners) {
    if (OrientationOf({corners, {}}) <= 0) {
      return false;
    }
    const TriangleInMap triangle_in_map{{ToMetres(points_[corners[0]]),
                                         ToMetres(points_[corners[1]]),
                                         ToMetres(points_[corners[2]])}};
    return SmallestAngleSineSquared(ShapeOf(triangle_in_map)) >= kSineSquaredMin;
  });
}

}  // namespace loci
