// SPDX-License-Identifier: Apache-2.0
#include "core/scan/scan_points.h"

#include "core/base/math.h"

namespace loci {

std::vector<ScanPoint> ToPoints(const LaserScan& scan, double range_max_m) {
  std::vector<ScanPoint> points;
  points.reserve(scan.ranges_mm.size());
  const Transformer2 robot_from_laser(scan.robot_from_laser);
  for (std::size_t i = 0; i < scan.ranges_mm.size(); ++i) {
    const double range_m = 0.001 * scan.ranges_mm[i];
    if (scan.ranges_mm[i] == LaserScan::kNothingSeen || range_m < kRangeMinM ||
        range_m > range_max_m) {
      continue;
    }
    const double angle_rad = scan.angle_min_rad + static_cast<double>(i) * scan.angle_step_rad;
    const Eigen::Vector2d point_in_laser(range_m * Cos(angle_rad), range_m * Sin(angle_rad));
    points.push_back({robot_from_laser * point_in_laser, static_cast<std::uint32_t>(i)});
  }
  return points;
}

}  // namespace loci
