// SPDX-License-Identifier: Apache-2.0
// Registration below the cell: points against the lines that a patch's cell means form.
#pragma once

#include <span>

#include <Eigen/Core>

#include "core/geometry/se2.h"
#include "core/place/patch.h"

namespace loci {

struct RegistrationOptions {
  int iterations_max = 12;
  // A step that moves nothing by more than this (m, rad) is the last.
  double step_min = 1e-5;
  // Points further than this from their line take no part; the second gate applies from the fourth
  // step on, when the first ones have taken out the search's error.
  double first_gate_m = 0.2;
  double second_gate_m = 0.1;
  // A pose known before, in the patch's frame, and its information (order x, y, theta; right
  // perturbation): keeps the directions that the scene leaves open, as along a corridor.
  Pose2 prior_patch_from_robot;
  Eigen::Matrix3d prior_information = Eigen::Matrix3d::Zero();
};

struct Registration {
  Pose2 patch_from_robot;
  // Weighted J^T J / kLineSigmaM^2 at the result, without the prior; order (x, y, theta), right
  // perturbation. Optimistic: it counts readings as independent.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  std::size_t inlier_count = 0;  // points that found a line within the last gate
  double mean_residual_m = 0.0;  // of the inliers, absolute
};

// Width of the robust weight 1 / (1 + (e / sigma)^2), metres: the noise of a reading.
inline constexpr double kLineSigmaM = 0.03;

// Gauss-Newton over point-to-line residuals, from `start`. For each point the cell means within
// three cells, weighted by count and distance, give a local line (mean and principal direction).
Registration RegisterToLines(std::span<const Eigen::Vector2d> points_in_robot,
                             const Pose2& start,
                             const Patch& patch,
                             const RegistrationOptions& options);

}  // namespace loci
