// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/ray_caster.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace loci::simulator {
namespace {

using Eigen::Vector2d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double Cross(const Vector2d& a, const Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

}  // namespace

double DistanceTo(const Segment& segment, const Vector2d& origin, const Vector2d& direction) {
  const Vector2d along = segment.to - segment.from;
  const double denominator = Cross(direction, along);
  if (denominator == 0.0) {
    return kInfinity;  // parallel: an edge has no breadth
  }
  const Vector2d offset = segment.from - origin;
  const double distance_m = Cross(offset, along) / denominator;
  const double share = Cross(offset, direction) / denominator;
  return distance_m >= 0.0 && share >= 0.0 && share <= 1.0 ? distance_m : kInfinity;
}

double DistanceTo(const Disk& disk, const Vector2d& origin, const Vector2d& direction) {
  const Vector2d offset = disk.centre - origin;
  const double along_m = offset.dot(direction);
  const double beside2 = offset.squaredNorm() - along_m * along_m;
  const double radius2 = disk.radius_m * disk.radius_m;
  if (along_m <= 0.0 || beside2 > radius2 || offset.squaredNorm() <= radius2) {
    return kInfinity;
  }
  return along_m - std::sqrt(radius2 - beside2);
}

RayCaster::RayCaster(std::vector<Segment> segments) : segments_(std::move(segments)) {
  if (!segments_.empty()) {
    Vector2d high = segments_.front().from;
    low_ = high;
    for (const Segment& segment : segments_) {
      low_ = low_.cwiseMin(segment.from).cwiseMin(segment.to);
      high = high.cwiseMax(segment.from).cwiseMax(segment.to);
    }
    width_ = CellOf(high.x(), low_.x()) + 1;
    height_ = CellOf(high.y(), low_.y()) + 1;
  }
  cells_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (std::size_t index = 0; index < segments_.size(); ++index) {
    const Segment& segment = segments_[index];
    const Vector2d low = segment.from.cwiseMin(segment.to);
    const Vector2d high = segment.from.cwiseMax(segment.to);
    // All cells of its box: walls are straight with the axes nearly always. One cell more on each
    // side, so that rounding at a cell's border never loses a hit.
    const std::int32_t row_end = std::min(height_ - 1, CellOf(high.y(), low_.y()) + 1);
    const std::int32_t column_end = std::min(width_ - 1, CellOf(high.x(), low_.x()) + 1);
    for (std::int32_t row = std::max(0, CellOf(low.y(), low_.y()) - 1); row <= row_end; ++row) {
      for (std::int32_t column = std::max(0, CellOf(low.x(), low_.x()) - 1); column <= column_end;
           ++column) {
        cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
               static_cast<std::size_t>(column)]
            .push_back(static_cast<std::uint32_t>(index));
      }
    }
  }
}

std::int32_t RayCaster::CellOf(double coordinate, double low) const {
  return static_cast<std::int32_t>(std::floor((coordinate - low) / kCellSideM));
}

double RayCaster::Cast(const Vector2d& origin,
                       const Vector2d& direction,
                       double range_m,
                       std::span<const Disk> disks) const {
  double nearest_m = range_m;
  for (const Disk& disk : disks) {
    nearest_m = std::min(nearest_m, DistanceTo(disk, origin, direction));
  }
  // Half a cell a step: with the margin of one cell no segment on the way is passed over, and a hit
  // that is nearer than the cells looked at is final.
  const double step_m = 0.5 * kCellSideM;
  std::int32_t last_column = std::numeric_limits<std::int32_t>::min();
  std::int32_t last_row = last_column;
  for (double along_m = 0.0; along_m <= nearest_m + step_m; along_m += step_m) {
    const Vector2d point = origin + along_m * direction;
    const std::int32_t column = CellOf(point.x(), low_.x());
    const std::int32_t row = CellOf(point.y(), low_.y());
    if ((column == last_column && row == last_row) || column < 0 || row < 0 || column >= width_ ||
        row >= height_) {
      continue;
    }
    last_column = column;
    last_row = row;
    for (const std::uint32_t index :
         cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                static_cast<std::size_t>(column)]) {
      nearest_m = std::min(nearest_m, DistanceTo(segments_[index], origin, direction));
    }
  }
  return nearest_m;
}

}  // namespace loci::simulator
