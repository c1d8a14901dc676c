// SPDX-License-Identifier: Apache-2.0
// One scan of a robot's log.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/geometry/se2.h"

namespace loci {

struct LogScan {
  // A range of this value means that the beam saw nothing.
  static constexpr std::uint16_t kNothingSeen = 0xFFFF;

  std::int64_t stamp_ns = 0;
  Pose2 odom_from_robot;
  Pose2 robot_from_laser;
  double angle_min_rad = 0.0;   // of beam 0, in the laser's frame
  double angle_step_rad = 0.0;  // beam i looks along angle_min_rad + i * angle_step_rad; > 0
  std::vector<std::uint16_t> ranges_mm;
  std::size_t line = 0;  // of the log, from 1
};

}  // namespace loci
