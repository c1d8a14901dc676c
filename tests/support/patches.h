// SPDX-License-Identifier: Apache-2.0
// Patches of simulated worlds, for tests that match against them.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/place/patch.h"
#include "core/scan/scan_points.h"
#include "tests/support/generator.h"

namespace loci {

inline std::vector<Eigen::Vector2d> PointsOf(const LaserScan& scan, double range_max_m = 15.0) {
  std::vector<Eigen::Vector2d> points;
  for (const ScanPoint& point : ToPoints(scan, range_max_m)) {
    points.push_back(point.point_in_robot);
  }
  return points;
}

// What a robot that stood at each of the poses would hold of the world, in the frame of the world.
inline Patch PatchOf(const SimulatedWorld& world,
                     const std::vector<Pose2>& poses,
                     const Scanner& scanner,
                     RandomSequence& noise) {
  Patch patch;
  for (const Pose2& pose : poses) {
    for (const Eigen::Vector2d& point : PointsOf(world.Scan(pose, scanner, noise))) {
      patch.Add(pose * point, PatchContent::kOwn);
    }
  }
  return patch;
}

// The furnished room, seen all around from a few poses near its middle.
inline Patch PatchOfRoom(RandomSequence& noise) {
  std::vector<Pose2> poses;
  for (int i = 0; i < 8; ++i) {
    poses.push_back({0.2 * (i % 3) - 0.3, 0.15 * (i % 4) - 0.2, 0.7 * i - 2.5});
  }
  return PatchOf(FurnishedRoom(), poses, FullTurnScanner(360), noise);
}

}  // namespace loci
