// SPDX-License-Identifier: Apache-2.0
// Finished places of simulated worlds, for tests that compare them.
#pragma once

#include <vector>

#include "core/grid/occupancy_grid.h"
#include "core/place/place.h"
#include "tests/support/patches.h"

namespace loci {

// What a robot that stood at each of the poses holds of the world, in the frame `map_from_place`.
inline Place FinishedPlace(const SimulatedWorld& world,
                           const Pose2& map_from_place,
                           const std::vector<Pose2>& map_from_robot,
                           const Scanner& scanner,
                           RandomSequence& noise) {
  constexpr double kRangeMaxM = 15.0;
  Place place;
  for (const Pose2& pose : map_from_robot) {
    const Pose2 place_from_robot = Inverse(map_from_place) * pose;
    const LaserScan scan = world.Scan(pose, scanner, noise);
    const std::vector<Eigen::Vector2d> points = PointsOf(scan, kRangeMaxM);
    for (const Eigen::Vector2d& point : points) {
      place.patch.Add(place_from_robot * point, PatchContent::kOwn);
    }
    IntegrateScan(
        scan, points, place_from_robot, kRangeMaxM, place.patch.cell_size_m(), place.stationary);
  }
  place.coverage = Coverage::OfGrid(place.stationary, place.patch.cell_size_m());
  place.finished = true;
  return place;
}

// Poses every 0.2 m along a line, as key scans stand.
inline std::vector<Pose2> KeyPoses(const Pose2& first, double length_m) {
  std::vector<Pose2> poses;
  for (double x = 0.0; x <= length_m; x += 0.2) {
    poses.push_back(first * Pose2{x, 0.0, 0.0});
  }
  return poses;
}

}  // namespace loci
