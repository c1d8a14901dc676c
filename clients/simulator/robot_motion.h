// SPDX-License-Identifier: Apache-2.0
// How a simulated robot drives, and what its odometry makes of it.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/random.h"
#include "core/geometry/se2.h"

namespace loci::simulator {

inline constexpr double kMotionStepS = 0.02;

struct DriveSettings {
  double speed_m_s = 0.6;
  double turn_rate_max_rad_s = 0.8;
  double look_ahead_m = 0.4;  // how far ahead on its way the robot aims: less cuts corners less
  double standing_s = 1.0;    // at the beginning and at the end
};

// The robot's poses every kMotionStepS along the way through `waypoints` (at least two), beginning
// at the first one with its face to the second.
std::vector<Pose2> Drive(const std::vector<Eigen::Vector2d>& waypoints,
                         const DriveSettings& settings);

// A wheeled robot's faults: one of its own for the whole run, and noise.
struct OdometrySettings {
  double distance_scale = 1.01;     // of every distance
  double turn_scale = 1.01;         // of every turn
  double drift_rad_m = 0.002;       // turn that is felt for every metre driven
  double distance_noise_m = 0.005;  // standard deviation after one metre
  double turn_noise_rad = 0.005;    // after one metre or one radian
};

// What odometry tells of `map_from_robot`, pose by pose, beginning at the identity.
std::vector<Pose2> FeelOdometry(const std::vector<Pose2>& map_from_robot,
                                const OdometrySettings& settings,
                                RandomSequence& random);

}  // namespace loci::simulator
