// SPDX-License-Identifier: Apache-2.0
#include "core/mesh/mesh_state.h"

#include <algorithm>
#include <cmath>

#include "core/base/check.h"

namespace loci {
namespace {

// Anchors lie on a lattice of this spacing in their place's frame, none within half of it of
// another vertex (design.md, section 5).
constexpr double kLatticeM = 8.0;
constexpr std::int64_t kSpacingMinUnits =
    static_cast<std::int64_t>(0.5 * kLatticeM * kUnitsPerMetre);

// Where every lattice point around a square has a vertex within 4 m, no circle without vertices
// that touches the square has a radius above 4 m + 8 m / sqrt(2): Delaunay triangles there have
// sides below 19.4 m. A longer side tells of a triangle that reaches over from far away.
constexpr double kSideMaxM = 24.0;

// When an LTR is resampled (design.md, section 5).
constexpr double kStretchMin = 0.8;
constexpr double kStretchMax = 1.25;
constexpr double kThinSineSquared = 0.0669872981;  // of 15 degrees

std::array<std::int64_t, 2> LatticeSquareOf(const Eigen::Vector2d& point_in_place) {
  return {static_cast<std::int64_t>(std::floor(point_in_place.y() / kLatticeM)),
          static_cast<std::int64_t>(std::floor(point_in_place.x() / kLatticeM))};
}

}  // namespace

Mesh::State::Triple Mesh::State::TripleOf(const std::array<VertexId, 3>& vertices) {
  Triple triple = {vertices[0].value, vertices[1].value, vertices[2].value};
  std::sort(triple.begin(), triple.end());
  return triple;
}

std::array<VertexId, 3> Mesh::State::VerticesOf(TriangleIndex triangle) const {
  std::array<VertexId, 3> vertices;
  for (std::size_t i = 0; i < 3; ++i) {
    vertices[i].value = topology_.triangles()[triangle].corners[i] - Triangulation::kSuperCount;
  }
  return vertices;
}

SnappedPoint Mesh::State::SnappedPositionOf(VertexId vertex) const {
  return topology_.PointAt(vertex.value + Triangulation::kSuperCount);
}

Eigen::Vector2d Mesh::State::PositionOf(VertexId vertex) const {
  return ToMetres(SnappedPositionOf(vertex));
}

TriangleInMap Mesh::State::TriangleOf(const std::array<VertexId, 3>& vertices) const {
  return {{PositionOf(vertices[0]), PositionOf(vertices[1]), PositionOf(vertices[2])}};
}

bool Mesh::State::IsTurnedOver(const std::array<VertexId, 3>& vertices) const {
  return Orientation(SnappedPositionOf(vertices[0]),
                     SnappedPositionOf(vertices[1]),
                     SnappedPositionOf(vertices[2])) <= 0;
}

void Mesh::State::MovePlaces(std::span<const Pose2> map_from_place) {
  LOCI_CHECK(map_from_place.size() >= map_from_place_.size());
  const bool nothing_moved =
      std::equal(map_from_place_.begin(), map_from_place_.end(), map_from_place.begin());
  map_from_place_.assign(map_from_place.begin(), map_from_place.end());
  if (nothing_moved) {
    return;
  }
  std::vector<Transformer2> place_to_map;
  place_to_map.reserve(map_from_place.size());
  for (const Pose2& pose : map_from_place) {
    place_to_map.emplace_back(pose);
  }
  std::vector<SnappedPoint> points;
  points.reserve(anchors_.size());
  for (const Anchor& anchor : anchors_) {
    points.push_back(Snap(place_to_map[anchor.host.value] * anchor.point_in_place));
  }
  topology_.MovePoints(points);
  snapshot_ = nullptr;
  QueueAll();
}

std::vector<TriangleIndex> Mesh::State::TrianglesUnder(const Footprint& footprint,
                                                       const Pose2& map_from_place) const {
  std::vector<TriangleIndex> triangles;
  if (footprint.empty()) {
    return triangles;
  }
  const Transformer2 place_from_map(Inverse(map_from_place));
  std::vector<Eigen::Vector2d> vertices_in_place;
  vertices_in_place.reserve(anchors_.size());
  for (std::uint32_t i = 0; i < anchors_.size(); ++i) {
    vertices_in_place.push_back(place_from_map * PositionOf(VertexId{i}));
  }
  for (TriangleIndex t = 0; t < topology_.triangles().size(); ++t) {
    if (topology_.IsReal(t)) {
      const std::array<VertexId, 3> vertices = VerticesOf(t);
      if (footprint.Meets({vertices_in_place[vertices[0].value],
                           vertices_in_place[vertices[1].value],
                           vertices_in_place[vertices[2].value]})) {
        triangles.push_back(t);
      }
    }
  }
  return triangles;
}

std::vector<PlaceId> Mesh::State::HostsUnder(const LogOddsGrid& grid,
                                             const Pose2& map_from_place) const {
  const Footprint footprint(grid, cell_size_m_);
  std::vector<PlaceId> hosts;
  if (footprint.empty()) {
    return hosts;
  }
  const Transformer2 place_from_map(Inverse(map_from_place));
  for (const TriangleIndex t : TrianglesUnder(footprint, map_from_place)) {
    for (const VertexId vertex : VerticesOf(t)) {
      // A triangle that spans unmapped ground has corners far away; the footprint's own anchors
      // will cut it up, so those corners will not carry this place.
      const Eigen::Vector2d point = place_from_map * PositionOf(vertex);
      const Eigen::Vector2d nearest =
          point.cwiseMax(footprint.bounds().min).cwiseMin(footprint.bounds().max);
      if ((point - nearest).norm() <= kLatticeM) {
        hosts.push_back(anchors_[vertex.value].host);
      }
    }
  }
  std::sort(hosts.begin(), hosts.end());
  hosts.erase(std::unique(hosts.begin(), hosts.end()), hosts.end());
  return hosts;
}

bool Mesh::State::HasVertexWithin(const SnappedPoint& point, std::int64_t distance_units) const {
  for (std::uint32_t i = 0; i < anchors_.size(); ++i) {
    const SnappedPoint vertex = SnappedPositionOf(VertexId{i});
    const std::int64_t dx = std::int64_t{vertex.x} - point.x;
    const std::int64_t dy = std::int64_t{vertex.y} - point.y;
    if (dx * dx + dy * dy < distance_units * distance_units) {
      return true;
    }
  }
  return false;
}

void Mesh::State::AddAnchorsAround(const std::set<std::array<std::int64_t, 2>>& squares,
                                   std::int64_t margin,
                                   PlaceId place) {
  std::set<std::array<std::int64_t, 2>> nodes;
  for (const auto& [y, x] : squares) {
    for (std::int64_t dy = -margin; dy <= 1 + margin; ++dy) {
      for (std::int64_t dx = -margin; dx <= 1 + margin; ++dx) {
        nodes.insert({y + dy, x + dx});
      }
    }
  }
  const Transformer2 place_to_map(map_from_place_[place.value]);
  for (const auto& [y, x] : nodes) {
    const Eigen::Vector2d point_in_place =
        Eigen::Vector2d(static_cast<double>(x) * kLatticeM, static_cast<double>(y) * kLatticeM);
    const SnappedPoint point = Snap(place_to_map * point_in_place);
    if (!HasVertexWithin(point, kSpacingMinUnits)) {
      anchors_.push_back({place, point_in_place});
      topology_.Insert(point);
    }
  }
}

std::vector<Eigen::Vector2d> Mesh::State::Uncovered(
    const std::vector<Eigen::Vector2d>& points_in_place, PlaceId place) const {
  const Transformer2 place_to_map(map_from_place_[place.value]);
  std::vector<Eigen::Vector2d> uncovered;
  TriangleIndex at = 0;
  for (const Eigen::Vector2d& point : points_in_place) {
    at = topology_.Locate(Snap(place_to_map * point), at);
    bool covered = topology_.IsReal(at);
    if (covered) {
      const auto corners = TriangleOf(VerticesOf(at)).corners_in_map;
      for (std::size_t i = 0; i < 3; ++i) {
        covered =
            covered && (corners[i] - corners[(i + 1) % 3]).squaredNorm() <= kSideMaxM * kSideMaxM;
      }
    }
    if (!covered) {
      uncovered.push_back(point);
    }
  }
  return uncovered;
}

// The corners of the lattice squares under the points suffice in open country. Where one was left
// out because a vertex was near, the border of the points may stick out of the mesh; with one more
// ring of lattice points it cannot, since each of them has a vertex within 4 m and lies 8 m
// outside.
void Mesh::State::Cover(const std::vector<Eigen::Vector2d>& points_in_place, PlaceId place) {
  const auto squares_of = [](const std::vector<Eigen::Vector2d>& points) {
    std::set<std::array<std::int64_t, 2>> squares;
    for (const Eigen::Vector2d& point : points) {
      squares.insert(LatticeSquareOf(point));
    }
    return squares;
  };
  if (!topology_.valid()) {
    topology_.Rebuild();
  }
  AddAnchorsAround(squares_of(points_in_place), 0, place);
  const std::vector<Eigen::Vector2d> uncovered = Uncovered(points_in_place, place);
  if (!uncovered.empty()) {
    AddAnchorsAround(squares_of(uncovered), 1, place);
    // The argument above is one about Delaunay triangulations.
    if (!Uncovered(points_in_place, place).empty()) {
      topology_.Rebuild();
    }
  }
}

void Mesh::State::TopologyChanged() {
  topology_changed_ = now_;
  snapshot_ = nullptr;
  triangle_of_triple_.clear();
  for (TriangleIndex t = 0; t < topology_.triangles().size(); ++t) {
    if (topology_.IsReal(t)) {
      triangle_of_triple_.emplace_back(TripleOf(VerticesOf(t)), t);
    }
  }
  std::sort(triangle_of_triple_.begin(), triangle_of_triple_.end());
  QueueAll();
}

void Mesh::State::QueueAll() {
  to_dissolve_.clear();
  thin_.clear();
  for (const auto& [id, ltr] : ltrs_) {
    Queue(id);
  }
}

void Mesh::State::Queue(LtrId id) {
  const Ltr& ltr = ltrs_.at(id);
  const Triple triple = TripleOf(ltr.vertices);
  const auto found = std::lower_bound(triangle_of_triple_.begin(),
                                      triangle_of_triple_.end(),
                                      std::pair<Triple, TriangleIndex>(triple, 0));
  if (found == triangle_of_triple_.end() || found->first != triple) {
    to_dissolve_.insert(id);
    return;
  }
  const TriangleShape shape = ShapeOf(TriangleOf(ltr.vertices));
  const Stretch stretch = StretchBetween(ltr.shape_when_laid_out, shape);
  if (stretch.smallest < kStretchMin || stretch.largest > kStretchMax) {
    to_dissolve_.insert(id);
  }
  // A thin triangle at the border that no flip makes better stays as it is.
  if (SmallestAngleSineSquared(shape) < kThinSineSquared && topology_.CanImprove(found->second)) {
    thin_.insert(id);
  }
}

bool Mesh::State::HasWork() const {
  return !topology_.valid() || !thin_.empty() || !to_dissolve_.empty();
}

void Mesh::State::Work(std::uint32_t ltr_count_max) {
  for (std::uint32_t count = 0; count < ltr_count_max && HasWork(); ++count) {
    if (!topology_.valid()) {
      topology_.Rebuild();
      TopologyChanged();
    } else if (!thin_.empty()) {
      const Triple triple = TripleOf(ltrs_.at(*thin_.begin()).vertices);
      const auto found = std::lower_bound(triangle_of_triple_.begin(),
                                          triangle_of_triple_.end(),
                                          std::pair<Triple, TriangleIndex>(triple, 0));
      topology_.FlipToImprove(found->second);
      TopologyChanged();
    } else {
      Dissolve(*to_dissolve_.begin());
    }
  }
}

std::shared_ptr<const MeshSnapshot> Mesh::State::TakeSnapshot() {
  if (snapshot_ != nullptr) {
    return snapshot_;
  }
  auto snapshot = std::make_shared<MeshSnapshot>();
  snapshot->vertices_in_map.reserve(anchors_.size());
  for (std::uint32_t i = 0; i < anchors_.size(); ++i) {
    snapshot->vertices_in_map.push_back(PositionOf(VertexId{i}));
  }
  snapshot->ltrs.reserve(ltrs_.size());
  for (const auto& [id, ltr] : ltrs_) {
    if (!IsTurnedOver(ltr.vertices)) {
      snapshot->ltrs.push_back(
          {ltr.vertices,
           ltr.At(Layer::kOccupancy).Texture(ltr.layout),
           ltr.At(Layer::kMoving).empty() ? nullptr : ltr.At(Layer::kMoving).Texture(ltr.layout)});
    }
  }
  snapshot_ = std::move(snapshot);
  return snapshot_;
}

}  // namespace loci
