// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/simulation.h"

#include <algorithm>
#include <cmath>

#include "clients/simulator/ray_caster.h"
#include "core/base/random.h"

namespace loci::simulator {
namespace {

using Eigen::Vector2d;

// 2026-01-01, and a day in seconds.
constexpr std::int64_t kFirstDayS = 1'767'225'600;
constexpr std::int64_t kDayS = 86'400;
constexpr double kRobotRadiusM = 0.25;
// Nearer than this people are out of a robot's way, and of its sight.
constexpr double kPersonalDistanceM = 0.6;

struct Drives {
  const SessionPlan* session = nullptr;
  std::vector<Pose2> map_from_robot;
};

// Disks at one moment: columns, people, and the other robots of the day.
std::vector<Disk> DisksAt(const Scenario& scenario,
                          const std::vector<Drives>& drives,
                          const Drives& self,
                          std::size_t step) {
  std::vector<Disk> disks = scenario.plan.columns();
  const Vector2d own = self.map_from_robot[step].translation();
  for (const Disk& person : scenario.plan.ComputePeople(static_cast<double>(step) * kMotionStepS)) {
    if ((person.centre - own).norm() > kPersonalDistanceM) {
      disks.push_back(person);
    }
  }
  for (const Drives& other : drives) {
    if (&other != &self && other.session->day == self.session->day) {
      const std::size_t at = std::min(step, other.map_from_robot.size() - 1);
      disks.push_back({other.map_from_robot[at].translation(), kRobotRadiusM});
    }
  }
  return disks;
}

std::vector<double> Scan(const Pose2& map_from_robot,
                         const LaserSettings& laser,
                         const RayCaster& caster,
                         const std::vector<Disk>& disks,
                         RandomSequence& random) {
  const Pose2 map_from_laser = map_from_robot * laser.robot_from_laser;
  std::vector<double> ranges_m;
  ranges_m.reserve(laser.beam_count);
  for (std::size_t beam = 0; beam < laser.beam_count; ++beam) {
    const double angle_rad = map_from_laser.theta + laser.angle_min_rad +
                             static_cast<double>(beam) * laser.angle_step_rad;
    const Vector2d direction(Cos(angle_rad), Sin(angle_rad));
    const double true_m =
        caster.Cast(map_from_laser.translation(), direction, laser.range_max_m, disks);
    // Both are drawn for every beam, so that what one beam sees changes no other beam's noise.
    const double noisy_m = true_m + laser.noise_m * random.NextNormal();
    const bool missed = random.NextUnit() < laser.miss_fraction;
    const bool seen = !missed && true_m < laser.range_max_m && noisy_m < laser.range_max_m;
    ranges_m.push_back(seen ? std::max(noisy_m, 0.02) : laser.range_max_m);
  }
  return ranges_m;
}

SimulatedSession Run(const Scenario& scenario,
                     const std::vector<Drives>& drives,
                     const Drives& self,
                     std::uint64_t seed) {
  const SessionPlan& plan = *self.session;
  const RayCaster caster(scenario.plan.ComputeSurfaces(plan.day, seed));
  const auto index = static_cast<std::uint64_t>(&self - drives.data());
  RandomSequence odometry_random(MixBits(seed) + 2 * index);
  RandomSequence laser_random(MixBits(seed) + 2 * index + 1);
  const std::vector<Pose2> odom_from_robot =
      FeelOdometry(self.map_from_robot, plan.odometry, odometry_random);
  SimulatedSession session;
  session.robot = plan.robot;
  session.session = plan.session;
  session.day = plan.day;
  session.laser = plan.laser;
  session.map_from_start = self.map_from_robot.front();
  const auto steps_per_scan = static_cast<std::size_t>(
      std::max(std::lround(1.0 / (plan.laser.rate_hz * kMotionStepS)), 1L));
  constexpr auto kStepNs = static_cast<std::int64_t>(kMotionStepS * 1e9);
  for (std::size_t step = 0; step < self.map_from_robot.size(); ++step) {
    if (step > 0) {
      session.distance_m +=
          (self.map_from_robot[step].translation() - self.map_from_robot[step - 1].translation())
              .norm();
    }
    if (step % steps_per_scan != 0) {
      continue;
    }
    SimulatedScan scan;
    scan.stamp_ns = (kFirstDayS + static_cast<std::int64_t>(plan.day) * kDayS) * 1'000'000'000 +
                    static_cast<std::int64_t>(step) * kStepNs;
    scan.map_from_robot = self.map_from_robot[step];
    scan.odom_from_robot = odom_from_robot[step];
    scan.ranges_m = Scan(scan.map_from_robot,
                         plan.laser,
                         caster,
                         DisksAt(scenario, drives, self, step),
                         laser_random);
    session.scans.push_back(std::move(scan));
  }
  return session;
}

}  // namespace

std::vector<SimulatedSession> Simulate(const Scenario& scenario, std::uint64_t seed) {
  std::vector<Drives> drives;
  for (const SessionPlan& session : scenario.sessions) {
    drives.push_back({&session, Drive(session.waypoints, DriveSettings())});
  }
  std::vector<SimulatedSession> sessions;
  for (const Drives& self : drives) {
    sessions.push_back(Run(scenario, drives, self, seed));
  }
  return sessions;
}

}  // namespace loci::simulator
