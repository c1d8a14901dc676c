// SPDX-License-Identifier: Apache-2.0
// How content gets into LTRs: consolidation and remeshing.
#include <algorithm>
#include <utility>

#include "core/base/check.h"
#include "core/mesh/mesh_state.h"

namespace loci {
namespace {

// Beyond these a sheet's triangle says nothing any more about where its content is; then each
// contribution goes where its place is.
constexpr double kFaithfulStretchMin = 0.5;
constexpr double kFaithfulStretchMax = 2.0;

// Slivers carry no content: square of the sine of the angle at the first vertex, 0.06 degrees.
constexpr double kSliverSineSquared = 1e-6;

bool BoxesMeet(const TriangleInMap& left, const TriangleInMap& right) {
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const auto low = [&](const TriangleInMap& triangle) {
      return std::min({triangle.corners_in_map[0][axis],
                       triangle.corners_in_map[1][axis],
                       triangle.corners_in_map[2][axis]});
    };
    const auto high = [&](const TriangleInMap& triangle) {
      return std::max({triangle.corners_in_map[0][axis],
                       triangle.corners_in_map[1][axis],
                       triangle.corners_in_map[2][axis]});
    };
    if (low(left) > high(right) || low(right) > high(left)) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::array<Eigen::Vector2d, 3> Mesh::State::InPlace(const TriangleInMap& triangle,
                                                    PlaceId place) const {
  const Transformer2 place_from_map(Inverse(map_from_place_[place.value]));
  return {place_from_map * triangle.corners_in_map[0],
          place_from_map * triangle.corners_in_map[1],
          place_from_map * triangle.corners_in_map[2]};
}

std::optional<Mesh::State::Target> Mesh::State::TargetOf(
    const std::array<VertexId, 3>& vertices) const {
  const auto known = ltr_of_triple_.find(TripleOf(vertices));
  if (known != ltr_of_triple_.end()) {
    const Ltr& ltr = ltrs_.at(known->second);
    return Target{ltr.vertices, TriangleOf(ltr.vertices), ltr.layout};
  }
  const std::array<VertexId, 3> ordered = OrderForCells(vertices, TriangleOf(vertices));
  const TriangleInMap triangle = TriangleOf(ordered);
  const TriangleShape shape = ShapeOf(triangle);
  if (!(shape.Determinant() > kSliverSineSquared * shape.uu * shape.vv)) {
    return std::nullopt;
  }
  return Target{ordered, triangle, LayOutCells(triangle, cell_size_m_)};
}

Ltr& Mesh::State::WritableLtr(const Target& target) {
  const Triple triple = TripleOf(target.vertices);
  const auto known = ltr_of_triple_.find(triple);
  snapshot_ = nullptr;
  if (known != ltr_of_triple_.end()) {
    Ltr& ltr = ltrs_.at(known->second);
    ltr.changed = now_;
    return ltr;
  }
  const LtrId id = next_ltr_++;
  topology_changed_ = now_;  // next_ltr_ is stored with the topology
  ltr_of_triple_.emplace(triple, id);
  const LtrLayer empty(target.layout.cell_count());
  const auto [made, inserted] = ltrs_.emplace(
      id,
      Ltr{target.vertices, target.layout, ShapeOf(target.triangle), {empty, empty}, now_, now_});
  LOCI_CHECK(inserted);
  return made->second;
}

void Mesh::State::Consolidate(const PlaceContent& content) {
  LOCI_CHECK(content.stationary != nullptr);
  LOCI_CHECK(content.place.value < map_from_place_.size());
  LOCI_CHECK(content.map_from_place == map_from_place_[content.place.value]);
  const Footprint footprint(*content.stationary, content.moving, cell_size_m_);
  if (footprint.empty()) {
    return;
  }
  Cover(footprint.SquareCorners(), content.place);
  for (const TriangleIndex t : TrianglesUnder(footprint, content.map_from_place)) {
    if (const std::optional<Target> target = TargetOf(VerticesOf(t)); target.has_value()) {
      Write(*target, content);
    }
  }
  TopologyChanged();
}

void Mesh::State::Write(const Target& target, const PlaceContent& content) {
  const Transformer2 place_from_map(Inverse(content.map_from_place));
  std::array<Eigen::Vector2d, 3> corners_in_place;
  for (std::size_t i = 0; i < 3; ++i) {
    corners_in_place[i] = place_from_map * target.triangle.corners_in_map[i];
  }
  for (const Layer layer : kLayers) {
    const LogOddsGrid* grid = layer == Layer::kOccupancy ? content.stationary : content.moving;
    if (grid == nullptr) {
      continue;
    }
    std::optional<std::vector<LogOdds8>> cells =
        SampleGrid(*grid, cell_size_m_, target.layout, corners_in_place);
    if (cells.has_value()) {
      cells_consolidated_ += CountObserved(*cells);
      WritableLtr(target).At(layer).Merge(
          {content.place, content.session, content.stamp_ns, corners_in_place, std::move(*cells)});
    }
  }
}

std::vector<std::pair<Mesh::State::Target, CellMap>> Mesh::State::TargetsUnder(
    const LtrLayout& layout, const TriangleInMap& triangle) const {
  std::vector<std::pair<Target, CellMap>> targets;
  for (TriangleIndex t = 0; t < topology_.triangles().size(); ++t) {
    if (!topology_.IsReal(t) || !BoxesMeet(TriangleOf(VerticesOf(t)), triangle)) {
      continue;
    }
    std::optional<Target> target = TargetOf(VerticesOf(t));
    if (!target.has_value()) {
      continue;
    }
    CellMap cell_map(layout, triangle, target->layout, target->triangle);
    if (!cell_map.empty()) {
      targets.emplace_back(std::move(*target), std::move(cell_map));
    }
  }
  return targets;
}

// Takes a sheet apart and gives what it holds to the triangles that are under it now.
void Mesh::State::Dissolve(LtrId id) {
  auto node = ltrs_.extract(id);
  const Ltr& sheet = node.mapped();
  ltr_of_triple_.erase(TripleOf(sheet.vertices));
  to_dissolve_.erase(id);
  thin_.erase(id);
  removed_.push_back({id, sheet.created, now_});
  snapshot_ = nullptr;
  topology_changed_ = now_;  // the counters are stored with it
  const LtrId first_new = next_ltr_;
  const bool is_faithful = IsFaithful(sheet);
  if (!is_faithful) {
    CoverByPlace(sheet);
  }
  for (const Layer layer : kLayers) {
    DissolveLayer(sheet, layer, is_faithful);
  }
  for (LtrId made = first_new; made < next_ltr_; ++made) {
    Queue(made);
  }
}

// HYMM, equation 2, says where the content is as long as the triangle is much as it was. One that
// was turned over or torn is left to its places: "contributions move by place" (design.md, section
// 5).
bool Mesh::State::IsFaithful(const Ltr& ltr) const {
  const Stretch stretch =
      StretchBetween(ltr.shape_when_laid_out, ShapeOf(TriangleOf(ltr.vertices)));
  return !IsTurnedOver(ltr.vertices) && stretch.smallest >= kFaithfulStretchMin &&
         stretch.largest <= kFaithfulStretchMax;
}

// There must be mesh where the contributions go.
void Mesh::State::CoverByPlace(const Ltr& sheet) {
  const auto cover = [&](const LtrContribution& contribution) {
    const std::vector<Eigen::Vector2d> points =
        ObservedPoints(sheet.layout, contribution.corners_in_place, contribution.cells);
    Cover(points, contribution.place);
  };
  for (const LtrLayer& layer : sheet.layers) {
    if (layer.base().has_value()) {
      cover(*layer.base());
    }
    for (const LtrContribution& contribution : layer.contributions()) {
      cover(contribution);
    }
  }
  TopologyChanged();
}

void Mesh::State::DissolveLayer(const Ltr& sheet, Layer layer, bool is_faithful) {
  const LtrLayer& content = sheet.At(layer);
  if (content.empty()) {
    return;
  }
  const TriangleInMap triangle = TriangleOf(sheet.vertices);
  std::vector<std::pair<Target, CellMap>> targets;
  if (is_faithful) {
    targets = TargetsUnder(sheet.layout, triangle);
  }
  const auto pour = [&](const LtrContribution& contribution, bool is_base) {
    if (!is_faithful) {
      const Transformer2 place_to_map(map_from_place_[contribution.place.value]);
      TriangleInMap by_place;
      for (std::size_t i = 0; i < 3; ++i) {
        by_place.corners_in_map[i] = place_to_map * contribution.corners_in_place[i];
      }
      targets = TargetsUnder(sheet.layout, by_place);
    }
    Pour(contribution, is_base, layer, targets);
  };
  if (content.base().has_value()) {
    pour(*content.base(), true);
  }
  for (const LtrContribution& contribution : content.contributions()) {
    pour(contribution, false);
  }
}

void Mesh::State::Pour(const LtrContribution& contribution,
                       bool is_base,
                       Layer layer,
                       const std::vector<std::pair<Target, CellMap>>& targets) {
  for (const auto& [target, cell_map] : targets) {
    std::optional<std::vector<LogOdds8>> cells = cell_map.Resample(contribution.cells);
    if (!cells.has_value()) {
      continue;
    }
    cells_remeshed_ += CountObserved(*cells);
    LtrContribution moved{contribution.place,
                          contribution.session,
                          contribution.stamp_ns,
                          InPlace(target.triangle, contribution.place),
                          std::move(*cells)};
    LtrLayer& into = WritableLtr(target).At(layer);
    if (is_base) {
      into.MergeBase(std::move(moved));
    } else {
      into.Merge(std::move(moved));
    }
  }
}

}  // namespace loci
