// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/building.h"

#include <algorithm>
#include <cmath>

namespace loci::simulator {
namespace {

long UnitsOf(double value_m) {
  return std::lround(value_m / kPlanUnitM);
}

// Free ground as a picture of squares of one plan unit, with a border that is not free.
class Plan {
 public:
  explicit Plan(const std::vector<Box>& free) {
    x_min_ = y_min_ = 1L << 40;
    long x_max = -x_min_;
    long y_max = -y_min_;
    for (const Box& box : free) {
      x_min_ = std::min(x_min_, UnitsOf(box.x_min) - 1);
      y_min_ = std::min(y_min_, UnitsOf(box.y_min) - 1);
      x_max = std::max(x_max, UnitsOf(box.x_max) + 1);
      y_max = std::max(y_max, UnitsOf(box.y_max) + 1);
    }
    width_ = std::max(0L, x_max - x_min_);
    height_ = std::max(0L, y_max - y_min_);
    free_.resize(static_cast<std::size_t>(width_ * height_));
    for (const Box& box : free) {
      for (long y = UnitsOf(box.y_min); y < UnitsOf(box.y_max); ++y) {
        for (long x = UnitsOf(box.x_min); x < UnitsOf(box.x_max); ++x) {
          free_[Index(x, y)] = true;
        }
      }
    }
  }

  // Runs of border between free and solid squares, as long as they go straight on.
  std::vector<Wall> Outline() const {
    std::vector<Wall> walls;
    for (long y = y_min_ + 1; y < y_min_ + height_; ++y) {
      AddRuns(
          walls,
          width_,
          [&](long i) { return IsFree(x_min_ + i, y) != IsFree(x_min_ + i, y - 1); },
          [&](long i) { return PointAt(x_min_ + i, y); });
    }
    for (long x = x_min_ + 1; x < x_min_ + width_; ++x) {
      AddRuns(
          walls,
          height_,
          [&](long i) { return IsFree(x, y_min_ + i) != IsFree(x - 1, y_min_ + i); },
          [&](long i) { return PointAt(x, y_min_ + i); });
    }
    return walls;
  }

 private:
  std::size_t Index(long x, long y) const {
    return static_cast<std::size_t>((y - y_min_) * width_ + x - x_min_);
  }
  bool IsFree(long x, long y) const { return free_[Index(x, y)]; }
  static Eigen::Vector2d PointAt(long x, long y) {
    return {kPlanUnitM * static_cast<double>(x), kPlanUnitM * static_cast<double>(y)};
  }

  template <typename IsBorder, typename PointOf>
  static void AddRuns(std::vector<Wall>& walls, long count, IsBorder is_border, PointOf point_of) {
    for (long i = 0; i < count;) {
      if (!is_border(i)) {
        ++i;
        continue;
      }
      const long begin = i;
      while (i < count && is_border(i)) {
        ++i;
      }
      walls.push_back({point_of(begin), point_of(i)});
    }
  }

  long x_min_;
  long y_min_;
  long width_;
  long height_;
  std::vector<bool> free_;
};

}  // namespace

std::vector<Wall> WallsOf(const Building& building) {
  std::vector<Wall> walls = Plan(building.free).Outline();
  walls.insert(walls.end(), building.doors.begin(), building.doors.end());
  for (const Box& box : building.furniture) {
    const Eigen::Vector2d a(box.x_min, box.y_min);
    const Eigen::Vector2d b(box.x_max, box.y_min);
    const Eigen::Vector2d c(box.x_max, box.y_max);
    const Eigen::Vector2d d(box.x_min, box.y_max);
    walls.insert(walls.end(), {{a, b}, {b, c}, {c, d}, {d, a}});
  }
  return walls;
}

}  // namespace loci::simulator
