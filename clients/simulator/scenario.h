// SPDX-License-Identifier: Apache-2.0
// A building, and who drives where in it and when.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "clients/simulator/floor_plan.h"
#include "clients/simulator/robot_motion.h"
#include "core/base/status.h"
#include "core/geometry/se2.h"

namespace loci::simulator {

struct LaserSettings {
  std::size_t beam_count = 181;
  double angle_min_rad = -0.5 * kPi;
  double angle_step_rad = kPi / 180.0;
  double range_max_m = 30.0;
  double rate_hz = 5.0;
  double noise_m = 0.012;        // standard deviation
  double miss_fraction = 0.002;  // of beams that see nothing, for no reason
  Pose2 robot_from_laser = {0.18, 0.0, 0.0};
};

struct SessionPlan {
  std::string robot;
  std::string session;
  std::uint64_t day = 0;  // sessions of one day are driven at the same time
  std::vector<Eigen::Vector2d> waypoints;
  OdometrySettings odometry;
  LaserSettings laser;
};

struct Scenario {
  std::string name;
  FloorPlan plan;
  std::vector<SessionPlan> sessions;
};

struct ScenarioName {
  std::string name;
  std::string what;
};
// The built-in scenarios.
std::vector<ScenarioName> ScenarioNames();

// kNotFound names those that there are.
StatusOr<Scenario> MakeScenario(const std::string& name);

}  // namespace loci::simulator
