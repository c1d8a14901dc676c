// SPDX-License-Identifier: Apache-2.0
// What a grid holds, counted plainly.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/grid/log_odds_grid.h"

namespace loci {

// Number of cells that are not kUnobserved.
inline std::size_t ObservedCount(const LogOddsGrid& grid) {
  const CellBox box = grid.Bounds();
  std::size_t count = 0;
  for (std::int32_t y = box.min.y; y < box.max.y; ++y) {
    for (std::int32_t x = box.min.x; x < box.max.x; ++x) {
      count += grid.At({x, y}) != kUnobserved ? 1U : 0U;
    }
  }
  return count;
}

}  // namespace loci
