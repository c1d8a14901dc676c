// SPDX-License-Identifier: Apache-2.0
// Where a layer has content, and where two snapshots differ.
#include <algorithm>
#include <array>
#include <cstdint>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "core/tile/scene.h"
#include "core/tile/tile_renderer.h"

namespace loci {
namespace {

// What a thing looks like, for comparing: its source and where its corners are.
using Look = std::tuple<const void*, std::array<double, 6>>;

Look LookOf(const Drawable& drawable) {
  const auto& corners = drawable.polygon.corners_in_map;
  return {drawable.source,
          {corners[0].x(),
           corners[0].y(),
           corners[1].x(),
           corners[1].y(),
           corners[2].x(),
           corners[2].y()}};
}

std::vector<Look> SortedLooks(const Scene& scene) {
  std::vector<Look> looks;
  for (const Drawable* drawable : scene.drawables()) {
    looks.push_back(LookOf(*drawable));
  }
  // By address: the order differs from run to run, what is found in it does not.
  std::sort(looks.begin(), looks.end());
  return looks;
}

using RowMajorTiles = std::set<std::pair<std::int32_t, std::int32_t>>;  // (y, x)

// Tiles under what is not among the given looks.
void AddTilesOfOthers(const Scene& scene, const std::vector<Look>& looks, RowMajorTiles& tiles) {
  for (const Drawable* drawable : scene.drawables()) {
    if (std::binary_search(looks.begin(), looks.end(), LookOf(*drawable))) {
      continue;
    }
    for (const TileAddress& tile : TilesUnder(drawable->box, kDirtyTileZoom)) {
      tiles.insert({tile.y, tile.x});
    }
  }
}

void ExtendByCells(const Drawable& drawable, BoxInMap& bounds) {
  const TextureView& texture = drawable.polygon.texture;
  for (std::int32_t row = 0; row < texture.row_count; ++row) {
    const LogOdds8* cells = texture.cells + static_cast<std::ptrdiff_t>(row) * texture.column_count;
    std::int32_t first = 0;
    std::int32_t end = drawable.ColumnCount(row);
    while (first < end && cells[first] == kUnobserved) {
      ++first;
    }
    while (end > first && cells[end - 1] == kUnobserved) {
      --end;
    }
    if (first < end) {
      for (const std::int32_t column : {first, end}) {
        bounds.Extend(drawable.polygon.map_from_texture * Eigen::Vector2d(column, row));
        bounds.Extend(drawable.polygon.map_from_texture * Eigen::Vector2d(column, row + 1));
      }
    }
  }
}

}  // namespace

BoxInMap MapBounds(const Snapshot& snapshot, Layer layer) {
  const Scene scene(snapshot, {layer, {}, true, false});
  BoxInMap bounds;
  for (const Drawable* drawable : scene.drawables()) {
    if (!bounds.Contains(drawable->box)) {
      ExtendByCells(*drawable, bounds);
    }
  }
  return bounds;
}

std::vector<TileAddress> DirtyTiles(const Snapshot& before, const Snapshot& after, Layer layer) {
  const Scene old_scene(before, {layer, {}, true, false});
  const Scene new_scene(after, {layer, {}, true, false});
  const std::vector<Look> old_looks = SortedLooks(old_scene);
  const std::vector<Look> new_looks = SortedLooks(new_scene);
  RowMajorTiles dirty;
  AddTilesOfOthers(old_scene, new_looks, dirty);
  AddTilesOfOthers(new_scene, old_looks, dirty);
  std::vector<TileAddress> tiles;
  for (const auto& [y, x] : dirty) {
    tiles.push_back({kDirtyTileZoom, x, y});
  }
  return tiles;
}

}  // namespace loci
