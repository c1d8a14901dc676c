// SPDX-License-Identifier: Apache-2.0
// Scenarios: who drives where in which building, and what their sensors are like.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "clients/simulator/building.h"
#include "core/base/status.h"
#include "core/geometry/se2.h"

namespace loci::simulator {

// A person who walks to and fro.
struct Walker {
  Eigen::Vector2d from = Eigen::Vector2d::Zero();
  Eigen::Vector2d to = Eigen::Vector2d::Zero();
  double speed_m_per_s = 1.0;
};

// One run of one robot. Drives along straight lines through its waypoints and turns on the spot.
struct Run {
  std::string robot;
  std::string session;
  std::vector<Eigen::Vector2d> waypoints;  // in the frame of the building, at least two
  double start_s = 0.0;                    // when it sets off
};

// What happens at one time: runs at once, in the building as it is then.
struct Day {
  Building building;
  std::vector<Walker> walkers;
  std::vector<Run> runs;
};

struct Sensors {
  int beam_count = 181;  // over 180 degrees
  double range_max_m = 30.0;
  double range_sigma_m = 0.01;
  double period_s = 0.2;   // between scans
  Pose2 robot_from_laser;  // where the laser sits
  // Odometry: errors in proportion to what was driven and turned, and a bias of the heading.
  double odometry_scale = 0.02;         // wheels that are this much too small
  double odometry_noise = 0.02;         // of the distance
  double heading_noise_per_m = 0.004;   // radians at one metre, growing with the square root
  double heading_bias_per_m = 0.002;    // radians a metre
  double heading_noise_per_rad = 0.02;  // of the turn
};

struct Scenario {
  std::string name;
  std::string description;
  std::vector<Day> days;
  Sensors sensors;
};

// Names that MakeScenario knows, with a line about each.
struct ScenarioEntry {
  std::string name;
  std::string description;
};
std::vector<ScenarioEntry> ListScenarios();

// kNotFound, with the names that there are. The seed decides about furniture.
StatusOr<Scenario> MakeScenario(const std::string& name, std::uint64_t seed);

}  // namespace loci::simulator
