// SPDX-License-Identifier: Apache-2.0
// Drives a scenario: scans and odometry as a robot would log them, and the truth.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/simulator/scenario.h"

namespace loci::simulator {

struct SimulatedScan {
  std::int64_t stamp_ns = 0;
  Pose2 map_from_robot;   // the truth
  Pose2 odom_from_robot;  // what odometry says; the identity at the beginning
  // Metres; laser.range_max_m for nothing seen.
  std::vector<double> ranges_m;
};

struct SimulatedSession {
  std::string robot;
  std::string session;
  std::uint64_t day = 0;
  LaserSettings laser;
  Pose2 map_from_start;
  double distance_m = 0.0;
  std::vector<SimulatedScan> scans;
};

// The same scenario and seed give the same, to the last bit. Robots that drive on one day see each
// other; people step aside for robots.
std::vector<SimulatedSession> Simulate(const Scenario& scenario, std::uint64_t seed);

}  // namespace loci::simulator
