// SPDX-License-Identifier: Apache-2.0
// Writing scans into a place's local grids.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/se2.h"
#include "core/grid/log_odds_grid.h"
#include "core/scan/scan.h"
#include "core/scan/scan_points.h"

namespace loci {

// Evidence of one scan for one cell, in units of kLogOddsPerUnit: 0.88 for a hit, 0.4 for a miss.
// Two hits outweigh four misses: thin things that some beams slip past stay.
inline constexpr int kHitUnits = 22;
inline constexpr int kMissUnits = 10;
// A cell at or below this (-1.0) is confidently free: three misses and no hit.
inline constexpr int kConfidentlyFreeUnits = -25;

// Cell that contains a point of the grid's frame.
CellIndex CellOf(const Eigen::Vector2d& point, double cell_size_m);

// Writes one scan into `grid`, taken by a robot at `grid_from_robot`.
//
// Free space is the area between the scanner and its readings, scan-converted row by row, so a cell
// is written once however many beams cross it. Between neighbouring beams whose readings jump, only
// the area up to the nearer one is taken: no beam passed the rest. Beams that saw nothing free
// nothing. `hits` are the points (in the robot's frame) that mark their cells occupied: each cell
// once.
//
// Returns the number of cells written.
std::uint64_t IntegrateScan(const LaserScan& scan,
                            std::span<const Eigen::Vector2d> hits_in_robot,
                            const Pose2& grid_from_robot,
                            double range_max_m,
                            double cell_size_m,
                            LogOddsGrid& grid);

// Marks the cells of moving points in `grid`, each once. Returns the number of cells written.
std::uint64_t IntegrateMoving(std::span<const Eigen::Vector2d> points_in_robot,
                              const Pose2& grid_from_robot,
                              double cell_size_m,
                              LogOddsGrid& grid);

}  // namespace loci
