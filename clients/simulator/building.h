// SPDX-License-Identifier: Apache-2.0
// Buildings: rooms and corridors cut out of solid ground, and what stands in them.
#pragma once

#include <vector>

#include "clients/simulator/world.h"

namespace loci::simulator {

// A box along the axes, metres. Its sides are multiples of kPlanUnitM.
struct Box {
  double x_min = 0.0;
  double y_min = 0.0;
  double x_max = 0.0;
  double y_max = 0.0;
};

inline constexpr double kPlanUnitM = 0.1;

// Free boxes may overlap and touch: where they do there is no wall. Their outline is the walls.
struct Building {
  std::vector<Box> free;       // rooms, corridors, door openings
  std::vector<Wall> doors;     // closed ones: a wall across an opening
  std::vector<Box> furniture;  // stands on free ground
};

// Walls of the outline of the free boxes, of closed doors and of furniture.
std::vector<Wall> WallsOf(const Building& building);

}  // namespace loci::simulator
