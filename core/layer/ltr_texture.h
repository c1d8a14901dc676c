// SPDX-License-Identifier: Apache-2.0
// What one LTR shows of one layer, ready to be drawn.
#pragma once

#include <cstdint>
#include <vector>

#include "core/grid/log_odds_grid.h"

namespace loci {

// Cells in the triangle's affine frame.
//
// Cell (column, row) covers u in [column, column + 1) / column_count and v likewise. Row-major, v
// outermost. Meaningful are cells that touch the simplex u + v <= 1, and one more in each row, so
// that rounding along the long side finds a value.
struct LtrTexture {
  std::int32_t column_count = 0;  // along u: from the first to the second vertex
  std::int32_t row_count = 0;     // along v: from the first to the third vertex
  std::vector<LogOdds8> cells;    // clamp(base + contributions); kUnobserved where nothing was seen

  // Maxima over squares of kCoarseSide cells, for small pictures; laid out likewise. May be empty.
  static constexpr std::int32_t kCoarseSide = 8;
  std::int32_t coarse_column_count = 0;
  std::int32_t coarse_row_count = 0;
  std::vector<LogOdds8> coarse_cells;
};

}  // namespace loci
