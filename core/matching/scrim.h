// SPDX-License-Identifier: Apache-2.0
// The sampling and correlation based estimate of a match's covariance (SCRIM, section IV).
#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "core/geometry/covariance.h"
#include "core/geometry/se2.h"
#include "core/matching/likelihood_grid.h"
#include "core/place/patch.h"

namespace loci {

struct SamplingOptions {
  int sample_count = 50;  // N of the paper's section IV.A
  // Starts are drawn uniformly from the pose +- these, along and about the robot's axes.
  double half_translation_m = 0.2;
  double half_theta_rad = 0.1;
  std::uint64_t seed = 0;
};

// Covariance of `patch_from_robot`, a registered pose of `points_in_robot`.
//
// The registration is run from N randomly perturbed starts. Each result is weighted by its
// normalised correlation (equations 2 and 3: here the mean likelihood of the points in the grid of
// the patch); those above the median correlation make the covariance about the pose. A floor of
// (0.01 m, 0.01 m, 0.003 rad)^2 stands for what sampling cannot see. A corridor gives a long
// ellipse along the corridor.
Covariance3 SampleMatchCovariance(std::span<const Eigen::Vector2d> points_in_robot,
                                  const Pose2& patch_from_robot,
                                  const Patch& patch,
                                  const LikelihoodGrid& grid,
                                  const SamplingOptions& options);

}  // namespace loci
