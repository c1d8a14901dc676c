// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/simulation.h"

#include <algorithm>
#include <cmath>

#include "core/base/math.h"
#include "core/base/random.h"
#include "core/geometry/angle.h"

namespace loci::simulator {
namespace {

constexpr double kSpeedMPerS = 0.6;
constexpr double kTurnRadPerS = 0.8;
constexpr double kArrivedM = 0.1;
constexpr double kRobotRadiusM = 0.25;
constexpr double kPersonRadiusM = 0.22;
constexpr double kWallPointRangeM = 15.0;
constexpr double kFirstStampS = 100.0;
constexpr double kDayS = 86400.0;

// The true path of a run: one pose for each scan.
std::vector<Pose2> Drive(const std::vector<Eigen::Vector2d>& waypoints, double period_s) {
  const Eigen::Vector2d first = waypoints[1] - waypoints[0];
  Pose2 pose{waypoints[0].x(), waypoints[0].y(), Atan2(first.y(), first.x())};
  std::vector<Pose2> poses = {pose};
  for (std::size_t i = 1; i < waypoints.size(); ++i) {
    while ((waypoints[i] - pose.translation()).norm() > kArrivedM) {
      const Eigen::Vector2d ahead = waypoints[i] - pose.translation();
      const double turn = WrapAngle(Atan2(ahead.y(), ahead.x()) - pose.theta);
      const double turn_max = kTurnRadPerS * period_s;
      const double turned = std::clamp(turn, -turn_max, turn_max);
      // Slows down for bends, stands for sharp turns.
      const double forward = std::abs(turn) > 0.6 ? 0.0 : kSpeedMPerS * period_s * Cos(turn);
      pose = pose * Pose2{std::min(forward, ahead.norm()), 0.0, turned};
      poses.push_back(pose);
    }
  }
  return poses;
}

// To and fro between two points, with the time.
Eigen::Vector2d WalkerAt(const Walker& walker, double time_s) {
  const double length = (walker.to - walker.from).norm();
  const double way = std::fmod(time_s * walker.speed_m_per_s, 2.0 * length);
  const double part = (way <= length ? way : 2.0 * length - way) / length;
  return walker.from + part * (walker.to - walker.from);
}

// What the wheels say about a motion.
Pose2 Misread(const Pose2& motion, const Sensors& sensors, RandomSequence& random) {
  const double distance = motion.translation().norm();
  const double scale = 1.0 + sensors.odometry_scale + sensors.odometry_noise * random.NextNormal();
  const double heading =
      motion.theta + sensors.heading_bias_per_m * distance +
      sensors.heading_noise_per_m * std::sqrt(distance) * random.NextNormal() +
      sensors.heading_noise_per_rad * std::abs(motion.theta) * random.NextNormal();
  return {scale * motion.x, scale * motion.y, WrapAngle(heading)};
}

// Runs of one day, driven at once: they see each other.
class DaySimulator {
 public:
  DaySimulator(const Day& day, const Sensors& sensors)
      : day_(day), sensors_(sensors), world_(WallsOf(day.building)) {
    for (const Run& run : day.runs) {
      paths_.push_back(Drive(run.waypoints, sensors.period_s));
    }
  }

  SimulatedRun Record(std::size_t index, std::size_t day_number, std::uint64_t seed) const {
    const Run& run = day_.runs[index];
    RandomSequence random(seed);
    SimulatedRun recorded;
    recorded.robot = run.robot;
    recorded.session = run.session;
    recorded.day = day_number;
    Pose2 odom_from_robot;
    for (std::size_t i = 0; i < paths_[index].size(); ++i) {
      const Pose2& pose = paths_[index][i];
      if (i > 0) {
        odom_from_robot =
            odom_from_robot * Misread(Inverse(paths_[index][i - 1]) * pose, sensors_, random);
      }
      const double time_s = run.start_s + static_cast<double>(i) * sensors_.period_s;
      SimulatedScan scan;
      scan.stamp_s = kFirstStampS + kDayS * static_cast<double>(day_number) + time_s;
      scan.building_from_robot = pose;
      scan.odom_from_robot = odom_from_robot;
      Look(pose, DiscsAround(index, time_s), random, scan.ranges_m, recorded.wall_points);
      recorded.scans.push_back(std::move(scan));
    }
    return recorded;
  }

 private:
  std::vector<Disc> DiscsAround(std::size_t index, double time_s) const {
    std::vector<Disc> discs;
    for (const Walker& walker : day_.walkers) {
      discs.push_back({WalkerAt(walker, time_s), kPersonRadiusM});
    }
    for (std::size_t other = 0; other < paths_.size(); ++other) {
      const double since = time_s - day_.runs[other].start_s;
      if (other != index && since >= 0.0) {
        const std::size_t step =
            std::min(static_cast<std::size_t>(since / sensors_.period_s), paths_[other].size() - 1);
        discs.push_back({paths_[other][step].translation(), kRobotRadiusM});
      }
    }
    return discs;
  }

  void Look(const Pose2& building_from_robot,
            const std::vector<Disc>& discs,
            RandomSequence& random,
            std::vector<double>& ranges_m,
            std::vector<Eigen::Vector2d>& wall_points) const {
    const Pose2 laser = building_from_robot * sensors_.robot_from_laser;
    // 180 and 181 beams stand a degree apart, 360 and 361 half a degree.
    const double step = (sensors_.beam_count > 181 ? 0.5 : 1.0) * kPi / 180.0;
    for (int beam = 0; beam < sensors_.beam_count; ++beam) {
      const double angle = laser.theta - 0.5 * kPi + step * beam;
      const std::optional<RayHit> hit =
          world_.Cast(laser.translation(), angle, sensors_.range_max_m, discs);
      if (!hit.has_value()) {
        ranges_m.push_back(kNothingSeenM);
        continue;
      }
      ranges_m.push_back(hit->range_m + sensors_.range_sigma_m * random.NextNormal());
      if (hit->is_wall && hit->range_m <= kWallPointRangeM) {
        wall_points.push_back(laser.translation() +
                              hit->range_m * Eigen::Vector2d(Cos(angle), Sin(angle)));
      }
    }
  }

  const Day& day_;
  Sensors sensors_;
  World world_;
  std::vector<std::vector<Pose2>> paths_;  // by run
};

}  // namespace

std::vector<SimulatedRun> Simulate(const Scenario& scenario, std::uint64_t seed) {
  std::vector<SimulatedRun> runs;
  for (std::size_t day = 0; day < scenario.days.size(); ++day) {
    const DaySimulator simulator(scenario.days[day], scenario.sensors);
    for (std::size_t run = 0; run < scenario.days[day].runs.size(); ++run) {
      runs.push_back(simulator.Record(run, day, MixBits(seed) ^ MixBits(day * 1000 + run)));
    }
  }
  return runs;
}

}  // namespace loci::simulator
