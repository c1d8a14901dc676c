// SPDX-License-Identifier: Apache-2.0
// A tiny world of walls and a laser scanner in it, for tests of the core. What it makes depends on
// its arguments only.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/random.h"
#include "core/engine/event.h"
#include "core/geometry/se2.h"
#include "core/scan/scan.h"

namespace loci {

struct Wall {
  Eigen::Vector2d a;
  Eigen::Vector2d b;
};

// How the scanner of a test looks.
struct Scanner {
  std::size_t beam_count = 180;
  double angle_min_rad = -0.5 * kPi;
  double angle_step_rad = kPi / 180.0;
  double range_max_m = 30.0;  // beams that meet nothing before see nothing
  double sigma_m = 0.01;      // of a reading
  Pose2 robot_from_laser;
};

inline Scanner FullTurnScanner(std::size_t beam_count) {
  Scanner scanner;
  scanner.beam_count = beam_count;
  scanner.angle_min_rad = -kPi;
  scanner.angle_step_rad = 2.0 * kPi / static_cast<double>(beam_count);
  return scanner;
}

// Walls without thickness.
class SimulatedWorld {
 public:
  void AddWall(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { walls_.push_back({a, b}); }

  // The four sides of a rectangle.
  void AddBox(const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
    AddWall(low, {high.x(), low.y()});
    AddWall({high.x(), low.y()}, high);
    AddWall(high, {low.x(), high.y()});
    AddWall({low.x(), high.y()}, low);
  }

  // Distance from `origin` to the first wall along a direction; infinite if there is none.
  double Distance(const Eigen::Vector2d& origin, double angle_rad) const {
    const Eigen::Vector2d direction(Cos(angle_rad), Sin(angle_rad));
    double nearest = std::numeric_limits<double>::infinity();
    for (const Wall& wall : walls_) {
      const Eigen::Vector2d along = wall.b - wall.a;
      const Eigen::Vector2d to_wall = wall.a - origin;
      const double cross = direction.x() * along.y() - direction.y() * along.x();
      if (std::abs(cross) < 1e-12) {
        continue;  // parallel
      }
      const double distance = (to_wall.x() * along.y() - to_wall.y() * along.x()) / cross;
      const double part = (to_wall.x() * direction.y() - to_wall.y() * direction.x()) / cross;
      if (distance > 0.0 && part >= 0.0 && part <= 1.0) {
        nearest = std::min(nearest, distance);
      }
    }
    return nearest;
  }

  LaserScan Scan(const Pose2& map_from_robot, const Scanner& scanner, RandomSequence& noise) const {
    LaserScan scan;
    scan.robot_from_laser = scanner.robot_from_laser;
    scan.angle_min_rad = scanner.angle_min_rad;
    scan.angle_step_rad = scanner.angle_step_rad;
    const Pose2 map_from_laser = map_from_robot * scanner.robot_from_laser;
    for (std::size_t i = 0; i < scanner.beam_count; ++i) {
      const double angle_rad = map_from_laser.theta + scanner.angle_min_rad +
                               static_cast<double>(i) * scanner.angle_step_rad;
      const double distance_m = Distance(map_from_laser.translation(), angle_rad);
      const double reading_m = distance_m + scanner.sigma_m * noise.NextNormal();
      scan.ranges_mm.push_back(
          distance_m > scanner.range_max_m
              ? LaserScan::kNothingSeen
              : static_cast<std::uint16_t>(std::lround(1000.0 * std::clamp(reading_m, 0.0, 65.0))));
    }
    return scan;
  }

 private:
  std::vector<Wall> walls_;
};

// A room of 10 x 8 m around the origin, with things in it so that no direction is open and no turn
// of it looks like itself.
inline SimulatedWorld FurnishedRoom() {
  SimulatedWorld world;
  world.AddBox({-5.0, -4.0}, {5.0, 4.0});
  world.AddBox({2.0, 1.5}, {3.2, 2.4});
  world.AddBox({-3.5, -3.2}, {-2.0, -2.6});
  world.AddWall({-5.0, 1.5}, {-3.0, 1.5});
  world.AddWall({1.0, -4.0}, {1.6, -2.5});
  return world;
}

// Two parallel walls along x, so long that no scan sees their ends.
inline SimulatedWorld StraightCorridor(double width_m = 2.4) {
  SimulatedWorld world;
  world.AddWall({-200.0, -0.5 * width_m}, {200.0, -0.5 * width_m});
  world.AddWall({-200.0, 0.5 * width_m}, {200.0, 0.5 * width_m});
  return world;
}

// A ring of corridors around a block of `block_m`, with niches of different size and distance along
// the outer walls so that every stretch of it looks its own.
inline SimulatedWorld RingOfCorridors(double block_m, double width_m, std::uint64_t seed) {
  SimulatedWorld world;
  const double inner = 0.5 * block_m;
  const double outer = inner + width_m;
  world.AddBox({-inner, -inner}, {inner, inner});
  RandomSequence random(seed);
  for (int side = 0; side < 4; ++side) {
    const Pose2 map_from_side{0.0, 0.0, WrapAngle(0.5 * kPi * side)};
    const auto add = [&](double x0, double y0, double x1, double y1) {
      world.AddWall(map_from_side * Eigen::Vector2d(x0, y0),
                    map_from_side * Eigen::Vector2d(x1, y1));
    };
    double x = -outer;
    while (x < outer - 3.0) {
      const double begin = x + random.NextUniform(0.4, 1.6);
      const double end = std::min(begin + random.NextUniform(0.5, 1.8), outer - 0.5);
      const double depth = outer + random.NextUniform(0.3, 1.2);
      add(x, outer, begin, outer);
      add(begin, outer, begin, depth);
      add(begin, depth, end, depth);
      add(end, depth, end, outer);
      x = end;
    }
    add(x, outer, outer, outer);
  }
  return world;
}

// A robot that drives through a world, and what it tells of it: scans, and odometry that drifts.
struct DriftOptions {
  double scale = 1.0;           // of each step's length, as a wheel of a wrong size
  double turn_rad_per_m = 0.0;  // a bias: the robot believes it turned so much more
  double sigma_part = 0.02;     // noise, of each step's length and turn
};

// Odometry from the true motion.
inline Odometry DriftingOdometry(const Pose2& true_motion,
                                 const DriftOptions& drift,
                                 RandomSequence& noise) {
  const double length_m = true_motion.translation().norm();
  const double part = drift.scale * (1.0 + drift.sigma_part * noise.NextNormal());
  Odometry odometry;
  odometry.previous_from_robot = {
      part * true_motion.x,
      part * true_motion.y,
      WrapAngle(true_motion.theta * (1.0 + drift.sigma_part * noise.NextNormal()) +
                drift.turn_rad_per_m * length_m)};
  const double sigma_m = 0.1 * length_m + 0.005;
  const double sigma_rad = 0.05 * length_m + 0.1 * std::abs(true_motion.theta) + 0.003;
  odometry.covariance_upper = {
      sigma_m * sigma_m, 0.0, 0.0, sigma_m * sigma_m, 0.0, sigma_rad * sigma_rad};
  return odometry;
}

// Poses along the straight lines between `corners`, every `step_m`, looking ahead; at a corner the
// robot turns on the spot by at most `step_rad` a pose.
inline std::vector<Pose2> DriveAlong(const std::vector<Eigen::Vector2d>& corners,
                                     double step_m,
                                     double step_rad = 0.15) {
  std::vector<Pose2> poses;
  for (std::size_t i = 0; i + 1 < corners.size(); ++i) {
    const Eigen::Vector2d way = corners[i + 1] - corners[i];
    const double heading_rad = Atan2(way.y(), way.x());
    if (!poses.empty()) {
      const double turn_rad = WrapAngle(heading_rad - poses.back().theta);
      const int count = static_cast<int>(std::ceil(std::abs(turn_rad) / step_rad));
      const double from_rad = poses.back().theta;
      for (int k = 1; k <= count; ++k) {
        poses.push_back(
            {corners[i].x(), corners[i].y(), WrapAngle(from_rad + turn_rad * k / count)});
      }
    }
    const int count = static_cast<int>(std::ceil(way.norm() / step_m));
    for (int k = poses.empty() ? 0 : 1; k <= count; ++k) {
      const Eigen::Vector2d at = corners[i] + way * (static_cast<double>(k) / count);
      poses.push_back({at.x(), at.y(), heading_rad});
    }
  }
  return poses;
}

// The events of one session that drives along `map_from_robot` (true poses). Numbers begin with 1,
// stamps are 0.1 s apart from `first_stamp_ns` on.
inline std::vector<Event> ObservationsAlong(const SimulatedWorld& world,
                                            const std::vector<Pose2>& map_from_robot,
                                            const Scanner& scanner,
                                            const DriftOptions& drift,
                                            SessionId session,
                                            std::uint64_t seed,
                                            std::int64_t first_stamp_ns = 1'000'000'000) {
  RandomSequence noise(seed);
  std::vector<Event> events;
  for (std::size_t i = 0; i < map_from_robot.size(); ++i) {
    ObservationEvent event;
    event.session = session;
    event.number = i + 1;
    event.stamp_ns = first_stamp_ns + static_cast<std::int64_t>(i) * 100'000'000;
    if (i > 0) {
      const Pose2 motion = Inverse(map_from_robot[i - 1]) * map_from_robot[i];
      event.odometry = DriftingOdometry(motion, drift, noise);
    }
    event.scan = world.Scan(map_from_robot[i], scanner, noise);
    events.emplace_back(std::move(event));
  }
  return events;
}

}  // namespace loci
