// SPDX-License-Identifier: Apache-2.0
// One turn of a laser scanner, quantised as it is stored.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/geometry/se2.h"

namespace loci {

// Ranges are millimetres; kNothingSeen means that the beam came back from nowhere.
struct LaserScan {
  static constexpr std::uint16_t kNothingSeen = 0xFFFF;
  static constexpr std::size_t kBeamCountMax = 4096;

  Pose2 robot_from_laser;
  double angle_min_rad = 0.0;   // of beam 0, in the laser's frame
  double angle_step_rad = 0.0;  // beam i looks along angle_min_rad + i * angle_step_rad; > 0
  std::vector<std::uint16_t> ranges_mm;
};

template <typename Archive>
void Fields(Archive& archive, LaserScan& scan) {
  archive(scan.robot_from_laser, scan.angle_min_rad, scan.angle_step_rad, scan.ranges_mm);
}

}  // namespace loci
