// SPDX-License-Identifier: Apache-2.0
// Observations of a robot that drives around in a square room with a pillar, by exact ray casting.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "core/engine/event.h"

namespace loci {

// The pose at step `i`: a circle of 3 m radius, 5 cm a step.
inline Pose2 RoomDrivePose(std::uint64_t i) {
  const double angle_rad = static_cast<double>(i) * 0.05 / 3.0;
  return {3.0 * std::cos(angle_rad),
          3.0 * std::sin(angle_rad),
          WrapAngle(angle_rad + std::numbers::pi / 2.0)};
}

// Distance along a ray to the walls of the room (12 m x 10 m about the origin) or to the pillar.
inline double RoomDriveRange(const Pose2& pose, double bearing_rad) {
  const double dx = std::cos(pose.theta + bearing_rad);
  const double dy = std::sin(pose.theta + bearing_rad);
  const double to_x = std::abs(dx) < 1e-9 ? 1e9 : ((dx > 0.0 ? 6.0 : -6.0) - pose.x) / dx;
  const double to_y = std::abs(dy) < 1e-9 ? 1e9 : ((dy > 0.0 ? 5.0 : -5.0) - pose.y) / dy;
  double range_m = std::min(to_x, to_y);
  const double x = 0.5 - pose.x;  // pillar of 0.4 m radius at (0.5, 0.2)
  const double y = 0.2 - pose.y;
  const double along = x * dx + y * dy;
  const double off2 = x * x + y * y - along * along;
  if (along > 0.0 && off2 < 0.16) {
    range_m = std::min(range_m, along - std::sqrt(0.16 - off2));
  }
  return range_m;
}

// `count` observations, numbered from 1, 0.1 s apart.
inline std::vector<ObservationEvent> RoomDrive(std::uint64_t count) {
  std::vector<ObservationEvent> drive;
  for (std::uint64_t i = 0; i < count; ++i) {
    ObservationEvent event;
    event.number = i + 1;
    event.stamp_ns = static_cast<std::int64_t>(i + 1) * 100'000'000;
    const Pose2 pose = RoomDrivePose(i);
    if (i > 0) {
      event.odometry = Odometry{.previous_from_robot = Inverse(RoomDrivePose(i - 1)) * pose,
                                .covariance_upper = {1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-5}};
    }
    LaserScan scan;
    scan.angle_min_rad = -std::numbers::pi / 2.0;
    scan.angle_step_rad = std::numbers::pi / 90.0;
    for (int beam = 0; beam < 91; ++beam) {
      const double range_m = RoomDriveRange(pose, scan.angle_min_rad + beam * scan.angle_step_rad);
      scan.ranges_mm.push_back(static_cast<std::uint16_t>(std::lround(range_m * 1000.0)));
    }
    event.scan = scan;
    drive.push_back(event);
  }
  return drive;
}

}  // namespace loci
