// SPDX-License-Identifier: Apache-2.0
// Occupancy grids in map_server's format: a PGM picture and a YAML file that describes it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/status.h"

namespace loci {

// Three states, as a planner needs them. Row 0 is the lowest.
struct OccupancyMap {
  enum class Cell : std::uint8_t { kFree, kOccupied, kUnknown };

  double x_min_m = 0.0;  // lower left corner
  double y_min_m = 0.0;
  double resolution_m = 0.05;
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<Cell> cells;

  Cell& at(std::int32_t column, std::int32_t row) {
    return cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(column)];
  }
  Cell at(std::int32_t column, std::int32_t row) const {
    return cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(column)];
  }
};

// Writes NAME.yaml and NAME.pgm; `path` is NAME, with or without one of the two endings.
Status WriteGridFile(const std::string& path, const OccupancyMap& map);

// Reads a YAML file and the PGM beside it (trinary mode, no rotation). kInvalidArgument names file
// and field.
StatusOr<OccupancyMap> ReadGridFile(const std::string& yaml_path);

}  // namespace loci
