// SPDX-License-Identifier: Apache-2.0
// The mesh as readers see it: where its vertices are now, and the textures of its triangles.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "core/base/ids.h"
#include "core/grid/log_odds_grid.h"

namespace loci {

// What one LTR shows of one layer: cells in the triangle's affine frame.
//
// Cell (column, row) covers u in [column, column + 1) / column_count and v likewise; only cells
// that touch the simplex u + v <= 1 are meaningful. Row-major, v outermost.
struct LtrTexture {
  std::int32_t column_count = 0;  // along u: from the first to the second vertex
  std::int32_t row_count = 0;     // along v: from the first to the third vertex
  std::vector<LogOdds8> cells;    // clamp(base + contributions); kUnobserved where nothing was seen
};

struct LtrSnapshot {
  std::array<VertexId, 3> vertices;             // counter-clockwise when it is served
  std::shared_ptr<const LtrTexture> occupancy;  // never null
  std::shared_ptr<const LtrTexture> moving;     // null if nothing moved here
};

struct MeshSnapshot {
  std::vector<Eigen::Vector2d> vertices_in_map;  // by VertexId
  std::vector<LtrSnapshot> ltrs;                 // in a fixed order; those turned over are left out
};

}  // namespace loci
