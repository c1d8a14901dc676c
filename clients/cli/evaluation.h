// SPDX-License-Identifier: Apache-2.0
// How far an estimated trajectory or grid is from the true one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "clients/cli/grid_file.h"
#include "core/base/status.h"
#include "core/geometry/se2.h"

namespace loci {

struct StampedPose2 {
  std::int64_t stamp_ns = 0;
  Pose2 pose;
};

// Reads a TUM trajectory: stamp x y z qx qy qz qw in a line, # begins a comment; in order of stamp.
// kInvalidArgument names file and line.
StatusOr<std::vector<StampedPose2>> ReadTumFile(const std::string& path);

struct ErrorFigures {
  double rms = 0.0;
  double mean = 0.0;
  double max = 0.0;
};

struct TrajectoryErrors {
  std::size_t pair_count = 0;
  std::size_t unmatched_count = 0;  // estimated poses without a true one of their time
  ErrorFigures translation_m;       // in the frames as they are
  ErrorFigures rotation_rad;
  ErrorFigures aligned_translation_m;  // after the rigid motion that fits best
  ErrorFigures aligned_rotation_rad;
  Pose2 truth_from_estimate;  // that motion
};

// Pairs each estimated pose with the true pose at its stamp: interpolated between its neighbours
// if these are at most `gap_max_ns` apart.
// The alignment minimises the squares of the positions' distances (Horn 1987, in the plane).
// kInvalidArgument if fewer than two pairs are found.
StatusOr<TrajectoryErrors> CompareTrajectories(const std::vector<StampedPose2>& estimate,
                                               const std::vector<StampedPose2>& truth,
                                               std::int64_t gap_max_ns);

struct GridAgreement {
  // Occupied cells of both, dilated by one cell: intersection over union. `iou` where the
  // estimate has observed the cell or one beside it, so that the far face of a wall that was seen
  // from one side does not count; `iou_everywhere` with all that nobody has seen.
  double iou = 0.0;
  double iou_everywhere = 0.0;
  double precision = 0.0;  // share of the estimate's occupied cells that touch a true one
  double recall = 0.0;     // share of the true occupied cells, where observed, that touch one
  std::size_t occupied_estimate = 0;
  std::size_t occupied_truth = 0;  // where observed
};

// Cells are compared in the lattice of the truth. kInvalidArgument if the resolutions differ by
// more than 1 %, or either has no occupied cell.
StatusOr<GridAgreement> CompareGrids(const OccupancyMap& estimate, const OccupancyMap& truth);

}  // namespace loci
