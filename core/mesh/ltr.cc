// SPDX-License-Identifier: Apache-2.0
#include "core/mesh/ltr.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace loci {
namespace {

// std::floor without a call into the library, for numbers of cells.
std::int32_t FloorToCell(double x) {
  const auto truncated = static_cast<std::int32_t>(x);
  return truncated - (x < static_cast<double>(truncated) ? 1 : 0);
}

// (column, row) of a cell's lower corner -> point, for a triangle with these corners.
Affine2 FromCells(const LtrLayout& layout, const std::array<Eigen::Vector2d, 3>& corners) {
  return {corners[0],
          (corners[1] - corners[0]) / static_cast<double>(layout.column_count()),
          (corners[2] - corners[0]) / static_cast<double>(layout.row_count())};
}

// The point of the triangle nearest to a cell's centre, in cells. Centres of cells along the long
// side may lie outside, over a neighbour that takes no part.
Eigen::Vector2d NearestInside(const LtrLayout& layout, std::int32_t column, std::int32_t row) {
  const double u = (column + 0.5) / layout.column_count();
  const double v = (row + 0.5) / layout.row_count();
  const double beyond = std::max(0.0, u + v - 1.0);
  const double u_inside = std::clamp(u - 0.5 * beyond, 0.0, 1.0);
  return {u_inside * layout.column_count(),
          std::min(v - 0.5 * beyond, 1.0 - u_inside) * layout.row_count()};
}

std::int32_t CellCountAlong(const Eigen::Vector2d& edge, double cell_size_m) {
  // A hair less than the quotient, so that rounding does not add a cell to 8 m / 0.05 m.
  const double count = std::ceil(edge.norm() / cell_size_m - 1e-6);
  return static_cast<std::int32_t>(
      std::clamp(count, 1.0, static_cast<double>(LtrLayout::kSideCellCountMax)));
}

// Everything but vertices and layout, which are needed before.
template <typename Archive>
void VisitContent(Archive& archive, Ltr& ltr) {
  archive(ltr.shape_when_laid_out.uu, ltr.shape_when_laid_out.uv, ltr.shape_when_laid_out.vv);
  for (LtrLayer& layer : ltr.layers) {
    layer.VisitFields(archive);
  }
}

template <typename Archive>
void VisitForWriting(Archive& archive, const Ltr& ltr) {
  archive(ltr.vertices, ltr.layout.column_count(), ltr.layout.row_count());
  // VisitFields changes nothing in an archive that writes.
  VisitContent(archive, const_cast<Ltr&>(ltr));
}

}  // namespace

std::array<VertexId, 3> OrderForCells(const std::array<VertexId, 3>& vertices,
                                      const TriangleInMap& triangle) {
  const auto& corners = triangle.corners_in_map;
  // From the smallest id on, so that the order does not depend on where the triangle was begun.
  std::size_t best = 0;
  double best_cosine_squared = 2.0;
  const auto start = static_cast<std::size_t>(std::min_element(vertices.begin(), vertices.end()) -
                                              vertices.begin());
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t first = (start + i) % 3;
    const Eigen::Vector2d e_u = corners[(first + 1) % 3] - corners[first];
    const Eigen::Vector2d e_v = corners[(first + 2) % 3] - corners[first];
    const double dot = e_u.dot(e_v);
    const double cosine_squared = dot * dot / (e_u.dot(e_u) * e_v.dot(e_v));
    if (cosine_squared < best_cosine_squared) {
      best_cosine_squared = cosine_squared;
      best = first;
    }
  }
  return {vertices[best], vertices[(best + 1) % 3], vertices[(best + 2) % 3]};
}

LtrLayout LayOutCells(const TriangleInMap& triangle, double cell_size_m) {
  const auto& corners = triangle.corners_in_map;
  return {CellCountAlong(corners[1] - corners[0], cell_size_m),
          CellCountAlong(corners[2] - corners[0], cell_size_m)};
}

std::optional<std::vector<LogOdds8>> SampleGrid(
    const LogOddsGrid& grid,
    double cell_size_m,
    const LtrLayout& layout,
    const std::array<Eigen::Vector2d, 3>& corners_in_place) {
  const double cells_per_metre = 1.0 / cell_size_m;
  Affine2 grid_from_cells = FromCells(layout, corners_in_place);
  grid_from_cells.origin *= cells_per_metre;
  grid_from_cells.x_axis *= cells_per_metre;
  grid_from_cells.y_axis *= cells_per_metre;
  std::vector<LogOdds8> cells(layout.cell_count(), kUnobserved);
  bool any = false;
  CellIndex block_index{INT32_MIN, INT32_MIN};
  const LogOddsGrid::Block* block = nullptr;
  for (std::int32_t row = 0; row < layout.row_count(); ++row) {
    LogOdds8* out = cells.data() + layout.RowStart(row);
    for (std::int32_t column = 0; column < layout.RowSize(row); ++column) {
      const Eigen::Vector2d at = grid_from_cells * Eigen::Vector2d(column + 0.5, row + 0.5);
      const CellIndex cell{FloorToCell(at.x()), FloorToCell(at.y())};
      const CellIndex under{cell.x >> LogOddsGrid::kBlockBits, cell.y >> LogOddsGrid::kBlockBits};
      if (!(under == block_index)) {
        block_index = under;
        block = grid.FindBlock(under);
      }
      if (block != nullptr) {
        out[column] = block->cells[LogOddsGrid::OffsetOf(cell)];
        any = any || out[column] != kUnobserved;
      }
    }
  }
  return any ? std::optional(std::move(cells)) : std::nullopt;
}

CellMap::CellMap(const LtrLayout& source_layout,
                 const TriangleInMap& source,
                 const LtrLayout& target_layout,
                 const TriangleInMap& target)
    : source_of_target_(target_layout.cell_count(), kNone) {
  // Relative to a corner of the source, so that a map far from its origin loses no digits.
  const Eigen::Vector2d origin = source.corners_in_map[0];
  std::array<Eigen::Vector2d, 3> source_corners = source.corners_in_map;
  std::array<Eigen::Vector2d, 3> target_corners = target.corners_in_map;
  for (std::size_t i = 0; i < 3; ++i) {
    source_corners[i] -= origin;
    target_corners[i] -= origin;
  }
  const Affine2 source_from_target =
      Inverse(FromCells(source_layout, source_corners)) * FromCells(target_layout, target_corners);
  const double column_count = source_layout.column_count();
  const double row_count = source_layout.row_count();
  // A point on the edge between two triangles must be in one of them whatever the rounding.
  constexpr double kSlack = 1e-9;
  for (std::int32_t row = 0; row < target_layout.row_count(); ++row) {
    std::uint32_t* out = source_of_target_.data() + target_layout.RowStart(row);
    for (std::int32_t column = 0; column < target_layout.RowSize(row); ++column) {
      const Eigen::Vector2d at = source_from_target * NearestInside(target_layout, column, row);
      const double u = at.x() / column_count;
      const double v = at.y() / row_count;
      if (!(u >= -kSlack && v >= -kSlack && u + v <= 1.0 + kSlack)) {
        continue;
      }
      const std::int32_t from_row =
          std::clamp(FloorToCell(at.y()), 0, source_layout.row_count() - 1);
      const std::int32_t from_column =
          std::clamp(FloorToCell(at.x()), 0, source_layout.RowSize(from_row) - 1);
      out[column] = static_cast<std::uint32_t>(source_layout.RowStart(from_row)) +
                    static_cast<std::uint32_t>(from_column);
      empty_ = false;
    }
  }
}

std::optional<std::vector<LogOdds8>> CellMap::Resample(
    const std::vector<LogOdds8>& source_cells) const {
  std::vector<LogOdds8> cells(source_of_target_.size(), kUnobserved);
  bool any = false;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (source_of_target_[i] != kNone) {
      cells[i] = source_cells[source_of_target_[i]];
      any = any || cells[i] != kUnobserved;
    }
  }
  return any ? std::optional(std::move(cells)) : std::nullopt;
}

std::vector<Eigen::Vector2d> ObservedPoints(const LtrLayout& layout,
                                            const std::array<Eigen::Vector2d, 3>& corners,
                                            const std::vector<LogOdds8>& cells) {
  constexpr std::int32_t kSpacing = 4;
  const Affine2 from_cells = FromCells(layout, corners);
  std::vector<Eigen::Vector2d> points;
  for (std::int32_t row = 0; row < layout.row_count(); ++row) {
    const LogOdds8* in_row = cells.data() + layout.RowStart(row);
    std::int32_t next = 0;  // one point stands for the cells up to here
    for (std::int32_t column = 0; column < layout.RowSize(row); ++column) {
      if (in_row[column] != kUnobserved && column >= next) {
        points.push_back(from_cells * NearestInside(layout, column, row));
        next = column + kSpacing;
      }
    }
  }
  return points;
}

std::size_t CountObserved(const std::vector<LogOdds8>& cells) {
  return cells.size() -
         static_cast<std::size_t>(std::count(cells.begin(), cells.end(), kUnobserved));
}

std::string EncodeLtr(const Ltr& ltr) {
  BinaryWriter writer;
  VisitForWriting(writer, ltr);
  return writer.TakeBytes();
}

void AddToHash(HashArchive& archive, const Ltr& ltr) {
  VisitForWriting(archive, ltr);
}

StatusOr<Ltr> DecodeLtr(std::string_view bytes, std::size_t vertex_count) {
  BinaryReader reader(bytes);
  std::array<VertexId, 3> vertices;
  std::int32_t column_count = 0;
  std::int32_t row_count = 0;
  reader(vertices, column_count, row_count);
  const auto in_bounds = [](std::int32_t count) {
    return count >= 1 && count <= LtrLayout::kSideCellCountMax;
  };
  if (!in_bounds(column_count) || !in_bounds(row_count)) {
    return DataLossError("LTR: " + std::to_string(column_count) + " x " +
                         std::to_string(row_count) + " cells, each must be from 1 to " +
                         std::to_string(LtrLayout::kSideCellCountMax));
  }
  for (std::size_t i = 0; i < 3; ++i) {
    if (vertices[i].value >= vertex_count || vertices[i] == vertices[(i + 1) % 3]) {
      return DataLossError("LTR: vertex " + std::to_string(vertices[i].value) + ", there are " +
                           std::to_string(vertex_count));
    }
  }
  const LtrLayout layout(column_count, row_count);
  const LtrLayer empty(layout.cell_count());
  Ltr ltr{vertices, layout, {}, {empty, empty}, {}, {}};
  VisitContent(reader, ltr);
  LOCI_RETURN_IF_ERROR(reader.Finish("LTR"));
  const TriangleShape& shape = ltr.shape_when_laid_out;
  // Shapes come from snapped points: sides of at most 93 km, areas of at least half a unit squared.
  if (!(shape.uu > 0.0 && shape.uu < 1e10 && shape.vv > 0.0 && shape.vv < 1e10 &&
        shape.Determinant() > 0.0)) {
    return DataLossError("LTR: the shape it was laid out in has no area");
  }
  return ltr;
}

}  // namespace loci
