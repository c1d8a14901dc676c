// SPDX-License-Identifier: Apache-2.0
// The best pose of a scan in a likelihood grid, found by looking at all of them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/se2.h"
#include "core/matching/likelihood_grid.h"

namespace loci {

// Poses to look at: a box around a prediction, in steps.
struct SearchWindow {
  double half_x_m = 0.2;
  double half_y_m = 0.2;
  double half_theta_rad = 0.14;
  double step_theta_rad = 0.014;
  // Taken from the score of a pose at the border of the window; less in proportion to the squared
  // distance inside. Decides where the scene does not, as along a corridor.
  double border_penalty = 0.02;
};

struct CorrelativeMatch {
  Pose2 grid_from_robot;
  double score = 0.0;       // mean likelihood of the points, 0 to 1, less the penalty
  double likelihood = 0.0;  // without the penalty
  std::uint32_t raw = 0;    // sum of the bytes under the points
};

// Scores every pose prediction + (i * cell, j * cell, k * step_theta) in the window and returns the
// best; of equal ones the first in the order of (k, j, i). Exact: the same as the plain loop over
// all poses (FindBestPosePlainly), which tests hold it to.
CorrelativeMatch FindBestPose(std::span<const Eigen::Vector2d> points_in_robot,
                              const Pose2& predicted_grid_from_robot,
                              const SearchWindow& window,
                              const LikelihoodGrid& grid);

// The plain loop: what FindBestPose must equal. For tests and benchmarks.
CorrelativeMatch FindBestPosePlainly(std::span<const Eigen::Vector2d> points_in_robot,
                                     const Pose2& predicted_grid_from_robot,
                                     const SearchWindow& window,
                                     const LikelihoodGrid& grid);

// Mean likelihood of points at a pose, 0 to 1: the normalised correlation of SCRIM, equations 2 and
// 3, with the grid standing for the log-odds of the target.
double CorrelationAt(std::span<const Eigen::Vector2d> points_in_robot,
                     const Pose2& grid_from_robot,
                     const LikelihoodGrid& grid);

}  // namespace loci
