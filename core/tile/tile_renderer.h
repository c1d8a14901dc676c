// SPDX-License-Identifier: Apache-2.0
// Pictures of a layer: textured triangles and fresh places, drawn into a grid of pixels.
//
// What a pixel shows: at a point of the map, the values of all LTRs and of all overlays there are
// added, and the sum is clamped to +-kLtrLogOddsMax; kUnobserved where none has a value. A pixel as
// large as a cell, or smaller, shows the point at its centre. A larger pixel shows the maximum over
// points that lie at most one cell apart, so that a wall one cell thick does not vanish in a small
// picture. (The price: what is occupied looks thicker there.)
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/engine/snapshot.h"
#include "core/grid/log_odds_grid.h"
#include "core/layer/layer.h"
#include "core/tile/zoom.h"

namespace loci {

// A tile in picture order: row 0 is the top (largest y), row-major.
struct TileImage {
  std::array<LogOdds8, static_cast<std::size_t>(kTileSide) * kTileSide> pixels;
};

// A picture in map order: row 0 is the lowest (smallest y), row-major.
struct RasterImage {
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<LogOdds8> pixels;
};

// What RenderRegion draws: pixel (column, row) covers the square of side `resolution_m` with its
// lower left corner at origin_in_map + (column, row) * resolution_m.
struct RasterRegion {
  Eigen::Vector2d origin_in_map = Eigen::Vector2d::Zero();
  double resolution_m = 0.05;  // above 0
  std::int32_t width = 0;      // pixels, at least 1
  std::int32_t height = 0;     // pixels, at least 1
};

// `address` must be valid (Validate in zoom.h).
TileImage RenderTile(const Snapshot& snapshot, Layer layer, const TileAddress& address);

RasterImage RenderRegion(const Snapshot& snapshot, Layer layer, const RasterRegion& region);

// The smallest box that holds every observed cell of the layer; empty if there is none.
BoxInMap MapBounds(const Snapshot& snapshot, Layer layer);

// Tiles at kDirtyTileZoom that may look different in `after`: everything that moved, changed, came
// or went. Ordered by (y, x).
std::vector<TileAddress> DirtyTiles(const Snapshot& before, const Snapshot& after, Layer layer);

}  // namespace loci
