// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/world.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace loci::simulator {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kNearestM = 1e-6;  // a ray does not meet what it starts on

long SquareOf(double value, double side) {
  return static_cast<long>(std::floor(value / side));
}

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Distance along the ray to the wall.
double MeetWall(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction, const Wall& wall) {
  const Eigen::Vector2d along = wall.to - wall.from;
  const double denominator = Cross(direction, along);
  if (std::abs(denominator) < 1e-12) {
    return kNever;
  }
  const Eigen::Vector2d offset = wall.from - origin;
  const double range = Cross(offset, along) / denominator;
  const double part = Cross(offset, direction) / denominator;
  return range > kNearestM && part >= 0.0 && part <= 1.0 ? range : kNever;
}

double MeetDisc(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction, const Disc& disc) {
  const Eigen::Vector2d offset = disc.center - origin;
  const double along = offset.dot(direction);
  const double miss = offset.squaredNorm() - along * along;
  const double radius_squared = disc.radius_m * disc.radius_m;
  if (miss > radius_squared) {
    return kNever;
  }
  const double range = along - std::sqrt(radius_squared - miss);
  return range > kNearestM ? range : kNever;
}

}  // namespace

World::World(std::vector<Wall> walls) : walls_(std::move(walls)) {
  if (walls_.empty()) {
    return;
  }
  Eigen::Vector2d low = walls_[0].from;
  Eigen::Vector2d high = low;
  for (const Wall& wall : walls_) {
    low = low.cwiseMin(wall.from).cwiseMin(wall.to);
    high = high.cwiseMax(wall.from).cwiseMax(wall.to);
  }
  x_min_ = SquareOf(low.x(), kSquareM);
  y_min_ = SquareOf(low.y(), kSquareM);
  width_ = SquareOf(high.x(), kSquareM) - x_min_ + 1;
  height_ = SquareOf(high.y(), kSquareM) - y_min_ + 1;
  squares_.resize(static_cast<std::size_t>(width_ * height_));
  for (std::size_t i = 0; i < walls_.size(); ++i) {
    const Eigen::Vector2d wall_low = walls_[i].from.cwiseMin(walls_[i].to);
    const Eigen::Vector2d wall_high = walls_[i].from.cwiseMax(walls_[i].to);
    // Walls are along an axis or short, so their box is close to themselves.
    for (long y = SquareOf(wall_low.y(), kSquareM); y <= SquareOf(wall_high.y(), kSquareM); ++y) {
      for (long x = SquareOf(wall_low.x(), kSquareM); x <= SquareOf(wall_high.x(), kSquareM); ++x) {
        squares_[static_cast<std::size_t>((y - y_min_) * width_ + x - x_min_)].push_back(i);
      }
    }
  }
}

std::span<const std::size_t> World::WallsAt(long x, long y) const {
  if (x < x_min_ || y < y_min_ || x >= x_min_ + width_ || y >= y_min_ + height_) {
    return {};
  }
  return squares_[static_cast<std::size_t>((y - y_min_) * width_ + x - x_min_)];
}

double World::NearestWall(const Eigen::Vector2d& origin,
                          const Eigen::Vector2d& direction,
                          double range_max_m) const {
  // Walks from square to square (Amanatides and Woo 1987).
  long x = SquareOf(origin.x(), kSquareM);
  long y = SquareOf(origin.y(), kSquareM);
  const long step_x = direction.x() > 0.0 ? 1 : -1;
  const long step_y = direction.y() > 0.0 ? 1 : -1;
  const auto border = [](long square, long step) {
    return kSquareM * static_cast<double>(step > 0 ? square + 1 : square);
  };
  const auto until = [](double distance, double speed) {
    return speed == 0.0 ? kNever : distance / speed;
  };
  double next_x = until(border(x, step_x) - origin.x(), direction.x());
  double next_y = until(border(y, step_y) - origin.y(), direction.y());
  const double across_x = until(kSquareM, std::abs(direction.x()));
  const double across_y = until(kSquareM, std::abs(direction.y()));
  double nearest = kNever;
  double entered = 0.0;
  while (entered <= range_max_m && nearest > entered) {
    for (const std::size_t index : WallsAt(x, y)) {
      nearest = std::min(nearest, MeetWall(origin, direction, walls_[index]));
    }
    if (next_x < next_y) {
      entered = next_x;
      next_x += across_x;
      x += step_x;
    } else {
      entered = next_y;
      next_y += across_y;
      y += step_y;
    }
  }
  return nearest;
}

std::optional<RayHit> World::Cast(const Eigen::Vector2d& origin,
                                  double angle_rad,
                                  double range_max_m,
                                  std::span<const Disc> discs) const {
  const Eigen::Vector2d direction(std::cos(angle_rad), std::sin(angle_rad));
  RayHit hit{NearestWall(origin, direction, range_max_m), true};
  for (const Disc& disc : discs) {
    const double range = MeetDisc(origin, direction, disc);
    if (range < hit.range_m) {
      hit = {range, false};
    }
  }
  if (hit.range_m > range_max_m) {
    return std::nullopt;
  }
  return hit;
}

}  // namespace loci::simulator
