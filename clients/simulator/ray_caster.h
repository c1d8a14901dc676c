// SPDX-License-Identifier: Apache-2.0
// Where a beam ends: exact intersections with segments and disks.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "clients/simulator/floor_plan.h"

namespace loci::simulator {

// Holds the segments in a lattice of square cells, so that a beam looks only at those on its way.
class RayCaster {
 public:
  explicit RayCaster(std::vector<Segment> segments);

  // Distance from `origin` along `direction` (of length 1) to the first segment or disk; `range_m`
  // if there is none nearer. A disk around the origin is not seen.
  double Cast(const Eigen::Vector2d& origin,
              const Eigen::Vector2d& direction,
              double range_m,
              std::span<const Disk> disks) const;

  const std::vector<Segment>& segments() const { return segments_; }

 private:
  static constexpr double kCellSideM = 1.0;

  std::int32_t CellOf(double coordinate, double low) const;

  std::vector<Segment> segments_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  std::int32_t width_ = 1;
  std::int32_t height_ = 1;
  std::vector<std::vector<std::uint32_t>> cells_;  // indices of segments
};

// Distance along a beam to a segment, infinite if it misses.
double DistanceTo(const Segment& segment,
                  const Eigen::Vector2d& origin,
                  const Eigen::Vector2d& direction);
// The same to a disk's border from outside.
double DistanceTo(const Disk& disk,
                  const Eigen::Vector2d& origin,
                  const Eigen::Vector2d& direction);

}  // namespace loci::simulator
