// SPDX-License-Identifier: Apache-2.0
// What a place keeps of its grids after they are dropped: where it looked, and where it is sure
// that nothing stood.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/base/archive.h"
#include "core/grid/log_odds_grid.h"

namespace loci {

// Two bits for each square of 2 x 2 cells. The tests of a loop closure need them long after the
// place's grids went into the mesh (design.md, section 4.9, tests 2 and 3).
class Coverage {
 public:
  static constexpr std::int32_t kCellsPerSquare = 2;

  Coverage() = default;
  // A square is observed if one of its cells is; it is free if all of them are confidently free.
  static Coverage OfGrid(const LogOddsGrid& stationary, double cell_size_m);

  double square_size_m() const { return square_size_m_; }
  bool IsObserved(const Eigen::Vector2d& point_in_place) const {
    return Bit(observed_, point_in_place);
  }
  bool IsFree(const Eigen::Vector2d& point_in_place) const { return Bit(free_, point_in_place); }
  // Centres of all observed squares, row by row.
  std::vector<Eigen::Vector2d> ObservedCenters() const;

  template <typename Archive>
  friend void Fields(Archive& archive, Coverage& coverage) {
    archive(coverage.square_size_m_, coverage.x_min_, coverage.y_min_);
    archive(coverage.width_, coverage.height_, coverage.observed_, coverage.free_);
    if constexpr (Archive::kReads) {
      if (!coverage.IsPossible()) {
        archive.Fail();
        coverage = Coverage();
      }
    }
  }

 private:
  bool Bit(const std::vector<std::uint64_t>& bits, const Eigen::Vector2d& point_in_place) const;
  bool IsPossible() const;

  double square_size_m_ = 0.1;
  std::int32_t x_min_ = 0;  // in squares
  std::int32_t y_min_ = 0;
  std::int32_t width_ = 0;  // a multiple of 64: rows begin with a word
  std::int32_t height_ = 0;
  std::vector<std::uint64_t> observed_;
  std::vector<std::uint64_t> free_;
};

}  // namespace loci
