// SPDX-License-Identifier: Apache-2.0
// Where readings are expected: a byte per cell, high near occupied cells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/grid/log_odds_grid.h"
#include "core/place/patch.h"

namespace loci {

// A dense rectangle of bytes around the occupied cells of a patch: a Gaussian of sigma kSigmaM
// around each occupied cell, kReachCells wide, the maximum of all (notes on matching). It depends
// on the set of occupied cells only, not on their order, so it can be rebuilt from a patch.
class LikelihoodGrid {
 public:
  static constexpr double kSigmaM = 0.07;
  static constexpr std::int32_t kReachCells = 3;

  LikelihoodGrid() = default;
  // An empty grid over [min, max) in cells.
  LikelihoodGrid(CellBox box, double cell_size_m);
  // The grid of a patch's cells with at least `hits_min` hits, just large enough for them.
  static LikelihoodGrid OfPatch(const Patch& patch, std::uint32_t hits_min);

  // Adds an occupied cell. Cells whose reach leaves the box make it grow.
  void Add(CellIndex cell);

  // 0 outside of the box.
  std::uint8_t At(CellIndex cell) const {
    const std::int32_t x = cell.x - box_.min.x;
    const std::int32_t y = cell.y - box_.min.y;
    if (x < 0 || y < 0 || x >= width_ || y >= height_) {
      return 0;
    }
    return bytes_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                  static_cast<std::size_t>(x)];
  }

  CellBox box() const { return box_; }
  std::int32_t width() const { return width_; }
  std::int32_t height() const { return height_; }
  double cell_size_m() const { return cell_size_m_; }
  // Row-major from the box's lower left corner; 32 readable bytes follow the last cell.
  const std::uint8_t* bytes() const { return bytes_.data(); }

 private:
  void Resize(CellBox box);
  void MakeKernel();

  CellBox box_;
  std::int32_t width_ = 0;
  std::int32_t height_ = 0;
  double cell_size_m_ = 0.05;
  std::vector<std::uint8_t> bytes_;
  std::vector<std::uint8_t> kernel_;  // (2 * reach + 1)^2
};

}  // namespace loci
