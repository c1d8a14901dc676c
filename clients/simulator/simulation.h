// SPDX-License-Identifier: Apache-2.0
// Driving through a scenario: what the robots truly did and what their sensors said.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "clients/simulator/scenario.h"
#include "core/base/status.h"
#include "core/geometry/se2.h"

namespace loci::simulator {

// One scan and where it was taken.
struct SimulatedScan {
  double stamp_s = 0.0;
  Pose2 building_from_robot;     // the truth
  Pose2 odom_from_robot;         // what the wheels say; the identity at the start
  std::vector<double> ranges_m;  // the sensor's maximum reading where nothing was met
};

// One run, driven.
struct SimulatedRun {
  std::string robot;
  std::string session;
  std::size_t day = 0;
  std::vector<SimulatedScan> scans;
  std::vector<Eigen::Vector2d> wall_points;  // what true beams met of walls, within 15 m
};

// Ranges at or above this mean that nothing was seen, as the SICK scanners of the public logs say.
inline constexpr double kNothingSeenM = 81.91;

// Drives all runs. The same scenario and seed give the same numbers.
std::vector<SimulatedRun> Simulate(const Scenario& scenario, std::uint64_t seed);

}  // namespace loci::simulator
