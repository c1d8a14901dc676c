// SPDX-License-Identifier: Apache-2.0
// A laser scan as points.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/se2.h"
#include "core/scan/scan.h"

namespace loci {

// One usable reading of a scan.
struct ScanPoint {
  Eigen::Vector2d point_in_robot;  // metres
  std::uint32_t beam = 0;          // index in the scan
};

// Readings below this are the scanner's own housing or dirt on its window.
inline constexpr double kRangeMinM = 0.05;

// The readings from kRangeMinM to `range_max_m`, in order of the beams.
std::vector<ScanPoint> ToPoints(const LaserScan& scan, double range_max_m);

}  // namespace loci
