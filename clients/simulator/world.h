// SPDX-License-Identifier: Apache-2.0
// What a simulated laser can see: walls and round things.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace loci::simulator {

// A thin straight wall, seen from both sides. Metres, in the frame of the building.
struct Wall {
  Eigen::Vector2d from = Eigen::Vector2d::Zero();
  Eigen::Vector2d to = Eigen::Vector2d::Zero();
};

// A person, a robot, a post.
struct Disc {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
};

// What a ray met.
struct RayHit {
  double range_m = 0.0;
  bool is_wall = false;  // false: a disc
};

// Walls, sorted into squares so that a ray looks only at those near it.
class World {
 public:
  explicit World(std::vector<Wall> walls);

  // The nearest thing along a ray, exact; nothing within `range_max_m`. Discs are looked at one by
  // one: there are few.
  std::optional<RayHit> Cast(const Eigen::Vector2d& origin,
                             double angle_rad,
                             double range_max_m,
                             std::span<const Disc> discs) const;

  std::span<const Wall> walls() const { return walls_; }

 private:
  static constexpr double kSquareM = 2.0;

  double NearestWall(const Eigen::Vector2d& origin,
                     const Eigen::Vector2d& direction,
                     double range_max_m) const;
  std::span<const std::size_t> WallsAt(long x, long y) const;

  std::vector<Wall> walls_;
  long x_min_ = 0;  // in squares
  long y_min_ = 0;
  long width_ = 0;
  long height_ = 0;
  std::vector<std::vector<std::size_t>> squares_;  // walls that may touch each, row by row
};

}  // namespace loci::simulator
