// SPDX-License-Identifier: Apache-2.0
// What a place observed, as small squares: for asking which triangles lie under it.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "core/grid/log_odds_grid.h"

namespace loci {

// An axis-parallel square in the frame of a place, in metres.
struct SquareInPlace {
  Eigen::Vector2d min;
  Eigen::Vector2d max;
};

// Squares of kSquareCells x kSquareCells cells of which at least one is observed, in blocks of the
// grid. A fixed order: by block (y, x), then by square (y, x).
class Footprint {
 public:
  static constexpr std::int32_t kSquareCells = 8;

  Footprint(const LogOddsGrid& grid, double cell_size_m);
  // Of two grids together; the second may be null.
  Footprint(const LogOddsGrid& grid, const LogOddsGrid* other, double cell_size_m);

  bool empty() const { return blocks_.empty(); }
  // Of the whole footprint; it must not be empty.
  const SquareInPlace& bounds() const { return bounds_; }
  // True if the inside of the triangle meets that of a square. Either direction of turning.
  bool Meets(const std::array<Eigen::Vector2d, 3>& corners_in_place) const;
  // Corners of all squares; some appear more than once.
  std::vector<Eigen::Vector2d> SquareCorners() const;

 private:
  struct Block {
    SquareInPlace bounds;
    std::vector<SquareInPlace> squares;
  };

  void AddBlocks(const LogOddsGrid& grid, double cell_size_m);

  std::vector<Block> blocks_;
  SquareInPlace bounds_{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
};

}  // namespace loci
