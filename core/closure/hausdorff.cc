// SPDX-License-Identifier: Apache-2.0
#include "core/closure/hausdorff.h"

#include <algorithm>

#include "core/grid/occupancy_grid.h"

namespace loci {
namespace {

constexpr std::uint32_t kHitsMin = 2;

// True if the patch has a mean within kHausdorffReachM.
bool HasMeanNear(const Patch& patch, const Eigen::Vector2d& point) {
  const std::int32_t reach = static_cast<std::int32_t>(kHausdorffReachM / patch.cell_size_m()) + 1;
  const CellIndex center = CellOf(point, patch.cell_size_m());
  for (std::int32_t dy = -reach; dy <= reach; ++dy) {
    for (std::int32_t dx = -reach; dx <= reach; ++dx) {
      const std::int32_t index = patch.Find({center.x + dx, center.y + dy});
      if (index >= 0 &&
          (patch.cells()[static_cast<std::size_t>(index)].Mean() - point).squaredNorm() <=
              kHausdorffReachM * kHausdorffReachM) {
        return true;
      }
    }
  }
  return false;
}

struct Count {
  std::size_t points = 0;  // in the area that both observed
  std::size_t near = 0;
  std::size_t in_free = 0;
};

Count CountPoints(const Place& from, const Place& to, const Pose2& from_from_to) {
  Count count;
  const Transformer2 transform(from_from_to);
  for (const PatchCell& cell : to.patch.cells()) {
    if (cell.hits < kHitsMin || !to.coverage.IsObserved(cell.Mean())) {
      continue;
    }
    const Eigen::Vector2d point = transform * cell.Mean();
    if (!from.coverage.IsObserved(point)) {
      continue;
    }
    ++count.points;
    if (HasMeanNear(from.patch, point)) {
      ++count.near;
    } else if (from.coverage.IsFree(point)) {
      ++count.in_free;
    }
  }
  return count;
}

double Fraction(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

double OverlapM2(const Place& from, const Place& to, const Pose2& from_from_to) {
  const Transformer2 transform(from_from_to);
  std::size_t squares = 0;
  for (const Eigen::Vector2d& center : to.coverage.ObservedCenters()) {
    if (from.coverage.IsObserved(transform * center)) {
      ++squares;
    }
  }
  const double side_m = to.coverage.square_size_m();
  return static_cast<double>(squares) * side_m * side_m;
}

}  // namespace

Agreement CompareFinishedPlaces(const Place& from, const Place& to, const Pose2& from_from_to) {
  const Count forth = CountPoints(from, to, from_from_to);
  const Count back = CountPoints(to, from, Inverse(from_from_to));
  return {Fraction(forth.near + back.near, forth.points + back.points),
          OverlapM2(from, to, from_from_to),
          std::max(Fraction(forth.in_free, forth.points), Fraction(back.in_free, back.points))};
}

}  // namespace loci
