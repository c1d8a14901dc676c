// SPDX-License-Identifier: Apache-2.0
// Uses core as a library.
#include <cstdio>

#include "core/base/status.h"
#include "core/geometry/se2.h"

int main() {
  const loci::Pose2 map_from_robot = loci::Pose2{1.0, 2.0, 0.0} * loci::Pose2{0.5, 0.0, 0.0};
  std::printf(
      "%.1f %.1f %s\n", map_from_robot.x, map_from_robot.y, loci::Status().ToString().c_str());
  return map_from_robot.x == 1.5 ? 0 : 1;
}
