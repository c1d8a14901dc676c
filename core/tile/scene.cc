// SPDX-License-Identifier: Apache-2.0
#include "core/tile/scene.h"

#include <algorithm>
#include <utility>

#include "core/base/check.h"

namespace loci {
namespace {

static_assert(LogOddsGrid::kBlockSide % LtrTexture::kCoarseSide == 0);

constexpr std::int32_t kCoarseBlockSide = LogOddsGrid::kBlockSide / LtrTexture::kCoarseSide;

TextureView ViewOf(const std::vector<LogOdds8>& cells, std::int32_t columns, std::int32_t rows) {
  return {cells.data(), columns, rows, cells.capacity() >= (cells.size() + 3) / 4 * 4};
}

BoxInMap BoxOf(const TexturedPolygon& polygon) {
  BoxInMap box;
  for (std::size_t i = 0; i < polygon.corner_count; ++i) {
    box.Extend(polygon.corners_in_map[i]);
  }
  return box;
}

void FillCoarse(const LogOddsGrid::Block& block, std::array<LogOdds8, 64>& coarse) {
  coarse.fill(kUnobserved);
  for (std::int32_t y = 0; y < LogOddsGrid::kBlockSide; ++y) {
    for (std::int32_t x = 0; x < LogOddsGrid::kBlockSide; ++x) {
      LogOdds8& cell = coarse[static_cast<std::size_t>(
          y / LtrTexture::kCoarseSide * kCoarseBlockSide + x / LtrTexture::kCoarseSide)];
      cell = std::max(cell, block.cells[LogOddsGrid::OffsetOf({x, y})]);
    }
  }
}

}  // namespace

std::int32_t Drawable::ColumnCount(std::int32_t row) const {
  const std::int32_t columns = polygon.texture.column_count;
  const std::int32_t rows = polygon.texture.row_count;
  if (polygon.corner_count == 4) {
    return columns;
  }
  return std::min(columns, (columns * (rows - row) + rows - 1) / rows);
}

Scene::Scene(const Snapshot& snapshot, const SceneOptions& options) {
  LOCI_CHECK(snapshot.mesh != nullptr);
  AddMesh(*snapshot.mesh, options);
  for (const OverlaySnapshot& overlay : snapshot.overlays) {
    LOCI_CHECK(overlay.place.value < snapshot.places.size());
    AddOverlay(options.layer == Layer::kOccupancy ? overlay.stationary : overlay.moving,
               snapshot.places[overlay.place.value].map_from_place,
               snapshot.settings.cell_size_m,
               options);
  }
  pointers_.reserve(drawables_.size());
  for (const Drawable& drawable : drawables_) {
    pointers_.push_back(&drawable);
  }
}

void Scene::Add(Drawable drawable, const SceneOptions& options) {
  drawable.box = BoxOf(drawable.polygon);
  if (options.everything || drawable.box.Intersects(options.box)) {
    drawables_.push_back(std::move(drawable));
  }
}

void Scene::AddMesh(const MeshSnapshot& mesh, const SceneOptions& options) {
  for (const LtrSnapshot& ltr : mesh.ltrs) {
    const LtrTexture* texture =
        options.layer == Layer::kOccupancy ? ltr.occupancy.get() : ltr.moving.get();
    if (texture == nullptr) {
      continue;
    }
    Drawable drawable;
    drawable.source = texture;
    TexturedPolygon& polygon = drawable.polygon;
    for (std::size_t i = 0; i < 3; ++i) {
      polygon.corners_in_map[i] = mesh.vertices_in_map[ltr.vertices[i].value];
    }
    const bool coarse = options.coarse && !texture->coarse_cells.empty();
    const double side = coarse ? LtrTexture::kCoarseSide : 1.0;
    polygon.texture =
        coarse
            ? ViewOf(texture->coarse_cells, texture->coarse_column_count, texture->coarse_row_count)
            : ViewOf(texture->cells, texture->column_count, texture->row_count);
    polygon.map_from_texture = {
        polygon.corners_in_map[0],
        (polygon.corners_in_map[1] - polygon.corners_in_map[0]) * (side / texture->column_count),
        (polygon.corners_in_map[2] - polygon.corners_in_map[0]) * (side / texture->row_count)};
    Add(std::move(drawable), options);
  }
}

void Scene::AddOverlay(const LogOddsGrid& grid,
                       const Pose2& map_from_place,
                       double cell_size_m,
                       const SceneOptions& options) {
  constexpr std::int32_t kSide = LogOddsGrid::kBlockSide;
  const Transformer2 place_to_map(map_from_place);
  const auto corner_in_map = [&](std::int32_t x, std::int32_t y) {
    return place_to_map * (Eigen::Vector2d(x, y) * cell_size_m);
  };
  const CellBox cells = grid.Bounds();
  for (std::int32_t y = cells.min.y; y < cells.max.y; y += kSide) {
    for (std::int32_t x = cells.min.x; x < cells.max.x; x += kSide) {
      const LogOddsGrid::Block* block =
          grid.FindBlock({x >> LogOddsGrid::kBlockBits, y >> LogOddsGrid::kBlockBits});
      if (block == nullptr) {
        continue;
      }
      Drawable drawable;
      drawable.source = block;
      TexturedPolygon& polygon = drawable.polygon;
      polygon.corner_count = 4;
      polygon.corners_in_map = {corner_in_map(x, y),
                                corner_in_map(x + kSide, y),
                                corner_in_map(x + kSide, y + kSide),
                                corner_in_map(x, y + kSide)};
      if (!options.everything && !BoxOf(polygon).Intersects(options.box)) {
        continue;
      }
      const std::int32_t side = options.coarse ? kCoarseBlockSide : kSide;
      polygon.texture = {block->cells.data(), side, side, true};
      if (options.coarse) {
        FillCoarse(*block, coarse_blocks_.emplace_back());
        polygon.texture.cells = coarse_blocks_.back().data();
      }
      polygon.map_from_texture = {polygon.corners_in_map[0],
                                  (polygon.corners_in_map[1] - polygon.corners_in_map[0]) / side,
                                  (polygon.corners_in_map[3] - polygon.corners_in_map[0]) / side};
      Add(std::move(drawable), options);
    }
  }
}

}  // namespace loci
