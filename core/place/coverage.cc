// SPDX-License-Identifier: Apache-2.0
#include "core/place/coverage.h"

#include <cmath>

#include "core/grid/occupancy_grid.h"

namespace loci {

Coverage Coverage::OfGrid(const LogOddsGrid& stationary, double cell_size_m) {
  Coverage coverage;
  coverage.square_size_m_ = kCellsPerSquare * cell_size_m;
  const CellBox bounds = stationary.Bounds();  // whole blocks of 64 cells, so 32 squares
  if (bounds.Empty()) {
    return coverage;
  }
  coverage.x_min_ = bounds.min.x / kCellsPerSquare;
  coverage.y_min_ = bounds.min.y / kCellsPerSquare;
  coverage.width_ = ((bounds.max.x - bounds.min.x) / kCellsPerSquare + 63) / 64 * 64;
  coverage.height_ = (bounds.max.y - bounds.min.y) / kCellsPerSquare;
  const std::size_t words_per_row = static_cast<std::size_t>(coverage.width_ / 64);
  coverage.observed_.resize(words_per_row * static_cast<std::size_t>(coverage.height_));
  coverage.free_.resize(coverage.observed_.size());
  for (std::int32_t row = 0; row < coverage.height_; ++row) {
    for (std::int32_t column = 0; column < coverage.width_; ++column) {
      const CellIndex cell{bounds.min.x + column * kCellsPerSquare,
                           bounds.min.y + row * kCellsPerSquare};
      bool observed = false;
      bool free = true;
      for (const CellIndex offset : {CellIndex{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
        const LogOdds8 value = stationary.At({cell.x + offset.x, cell.y + offset.y});
        observed = observed || value != kUnobserved;
        free = free && value != kUnobserved && value <= kConfidentlyFreeUnits;
      }
      const std::size_t word =
          static_cast<std::size_t>(row) * words_per_row + static_cast<std::size_t>(column / 64);
      const unsigned bit = static_cast<unsigned>(column % 64);
      coverage.observed_[word] |= static_cast<std::uint64_t>(observed) << bit;
      coverage.free_[word] |= static_cast<std::uint64_t>(free) << bit;
    }
  }
  return coverage;
}

bool Coverage::Bit(const std::vector<std::uint64_t>& bits,
                   const Eigen::Vector2d& point_in_place) const {
  const CellIndex square = CellOf(point_in_place, square_size_m_);
  const std::int32_t column = square.x - x_min_;
  const std::int32_t row = square.y - y_min_;
  if (column < 0 || row < 0 || column >= width_ || row >= height_) {
    return false;
  }
  const std::size_t word = static_cast<std::size_t>(row) * static_cast<std::size_t>(width_ / 64) +
                           static_cast<std::size_t>(column / 64);
  return ((bits[word] >> static_cast<unsigned>(column % 64)) & 1U) != 0;
}

std::vector<Eigen::Vector2d> Coverage::ObservedCenters() const {
  std::vector<Eigen::Vector2d> centers;
  for (std::int32_t row = 0; row < height_; ++row) {
    for (std::int32_t column = 0; column < width_; ++column) {
      const Eigen::Vector2d center((x_min_ + column + 0.5) * square_size_m_,
                                   (y_min_ + row + 0.5) * square_size_m_);
      if (Bit(observed_, center)) {
        centers.push_back(center);
      }
    }
  }
  return centers;
}

bool Coverage::IsPossible() const {
  // As far and as wide as a patch may be, in squares.
  constexpr std::int32_t kFarthest = (1 << 17) / kCellsPerSquare;
  constexpr std::int32_t kWidest = (1 << 16) / kCellsPerSquare + 64;
  if (!(square_size_m_ > 0.0) || width_ < 0 || height_ < 0 || width_ % 64 != 0 ||
      width_ > kWidest || height_ > kWidest || x_min_ < -kFarthest || x_min_ > kFarthest ||
      y_min_ < -kFarthest || y_min_ > kFarthest) {
    return false;
  }
  const std::size_t words =
      static_cast<std::size_t>(width_ / 64) * static_cast<std::size_t>(height_);
  return observed_.size() == words && free_.size() == words;
}

}  // namespace loci
