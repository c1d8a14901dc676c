// SPDX-License-Identifier: Apache-2.0
#include "core/mesh/footprint.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace loci {
namespace {

using CornersInPlace = std::array<Eigen::Vector2d, 3>;

bool HasObserved(const LogOddsGrid::Block& block, std::int32_t first_x, std::int32_t first_y) {
  static_assert(Footprint::kSquareCells == sizeof(std::uint64_t));
  constexpr std::uint64_t kNoneObserved = 0x8080808080808080ULL;
  for (std::int32_t y = first_y; y < first_y + Footprint::kSquareCells; ++y) {
    std::uint64_t row = 0;
    std::memcpy(&row, block.cells.data() + LogOddsGrid::OffsetOf({first_x, y}), sizeof(row));
    if (row != kNoneObserved) {
      return true;
    }
  }
  return false;
}

// Those of a block whose first cell is `first`.
std::vector<SquareInPlace> SquaresOf(const LogOddsGrid::Block& block,
                                     CellIndex first,
                                     double cell_size_m) {
  constexpr std::int32_t kStep = Footprint::kSquareCells;
  std::vector<SquareInPlace> squares;
  for (std::int32_t y = first.y; y < first.y + LogOddsGrid::kBlockSide; y += kStep) {
    for (std::int32_t x = first.x; x < first.x + LogOddsGrid::kBlockSide; x += kStep) {
      if (HasObserved(block, x, y)) {
        squares.push_back({Eigen::Vector2d(x, y) * cell_size_m,
                           Eigen::Vector2d(x + kStep, y + kStep) * cell_size_m});
      }
    }
  }
  return squares;
}

// Separating axes: the square's two directions and the triangle's three edges. Corners turn left.
bool InsidesMeet(const CornersInPlace& corners, const SquareInPlace& square) {
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const double low = std::min({corners[0][axis], corners[1][axis], corners[2][axis]});
    const double high = std::max({corners[0][axis], corners[1][axis], corners[2][axis]});
    if (high <= square.min[axis] || low >= square.max[axis]) {
      return false;
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector2d& from = corners[i];
    const Eigen::Vector2d edge = corners[(i + 1) % 3] - from;
    // The corner of the square that lies furthest to the left of the edge.
    const double x = edge.y() > 0.0 ? square.min.x() : square.max.x();
    const double y = edge.x() > 0.0 ? square.max.y() : square.min.y();
    if (edge.x() * (y - from.y()) - edge.y() * (x - from.x()) <= 0.0) {
      return false;
    }
  }
  return true;
}

}  // namespace

Footprint::Footprint(const LogOddsGrid& grid, double cell_size_m)
    : Footprint(grid, nullptr, cell_size_m) {}

Footprint::Footprint(const LogOddsGrid& grid, const LogOddsGrid* other, double cell_size_m) {
  AddBlocks(grid, cell_size_m);
  if (other != nullptr) {
    AddBlocks(*other, cell_size_m);
  }
  if (!blocks_.empty()) {
    bounds_ = blocks_.front().bounds;
  }
  for (const Block& block : blocks_) {
    bounds_.min = bounds_.min.cwiseMin(block.bounds.min);
    bounds_.max = bounds_.max.cwiseMax(block.bounds.max);
  }
}

void Footprint::AddBlocks(const LogOddsGrid& grid, double cell_size_m) {
  constexpr std::int32_t kSide = LogOddsGrid::kBlockSide;
  const CellBox cells = grid.Bounds();
  for (std::int32_t y = cells.min.y; y < cells.max.y; y += kSide) {
    for (std::int32_t x = cells.min.x; x < cells.max.x; x += kSide) {
      const LogOddsGrid::Block* found =
          grid.FindBlock({x >> LogOddsGrid::kBlockBits, y >> LogOddsGrid::kBlockBits});
      if (found == nullptr) {
        continue;
      }
      Block block;
      block.squares = SquaresOf(*found, {x, y}, cell_size_m);
      if (!block.squares.empty()) {
        block.bounds = block.squares.front();
        for (const SquareInPlace& square : block.squares) {
          block.bounds.min = block.bounds.min.cwiseMin(square.min);
          block.bounds.max = block.bounds.max.cwiseMax(square.max);
        }
        blocks_.push_back(std::move(block));
      }
    }
  }
}

bool Footprint::Meets(const CornersInPlace& corners_in_place) const {
  if (blocks_.empty()) {
    return false;
  }
  CornersInPlace corners = corners_in_place;
  const Eigen::Vector2d first = corners[1] - corners[0];
  const Eigen::Vector2d second = corners[2] - corners[0];
  if (first.x() * second.y() - first.y() * second.x() < 0.0) {
    std::swap(corners[1], corners[2]);
  }
  if (!InsidesMeet(corners, bounds_)) {
    return false;
  }
  return std::any_of(blocks_.begin(), blocks_.end(), [&](const Block& block) {
    return InsidesMeet(corners, block.bounds) &&
           std::any_of(block.squares.begin(),
                       block.squares.end(),
                       [&](const SquareInPlace& square) { return InsidesMeet(corners, square); });
  });
}

std::vector<Eigen::Vector2d> Footprint::SquareCorners() const {
  std::vector<Eigen::Vector2d> corners;
  for (const Block& block : blocks_) {
    for (const SquareInPlace& square : block.squares) {
      corners.push_back(square.min);
      corners.emplace_back(square.max.x(), square.min.y());
      corners.push_back(square.max);
      corners.emplace_back(square.min.x(), square.max.y());
    }
  }
  return corners;
}

}  // namespace loci
