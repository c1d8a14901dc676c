// SPDX-License-Identifier: Apache-2.0
// Finding one place in another over a wide window: branch and bound on pyramids of maxima.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/se2.h"
#include "core/matching/correlative_search.h"
#include "core/matching/likelihood_grid.h"

namespace loci {

// A region of poses that a search passes over: those whose difference d = (x, y, theta) to `center`
// has d^T information d <= 1. Used to look for a second peak outside of the first one's ellipse.
struct ExcludedPoses {
  Pose2 center;
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
};

// A likelihood grid with the maxima over squares of 2, 4, ... cells, so that many poses can be
// ruled out at once.
class WideSearch {
 public:
  explicit WideSearch(const LikelihoodGrid& grid);

  // The best pose in the window with a score above `score_min` (as SearchWindow and
  // CorrelativeMatch have it), or nothing. Exact over the window's steps.
  std::optional<CorrelativeMatch> FindBest(std::span<const Eigen::Vector2d> points,
                                           const Pose2& predicted,
                                           const SearchWindow& window,
                                           double score_min,
                                           const ExcludedPoses* excluded) const;

 private:
  static constexpr int kLevelCount = 5;  // squares of 1, 2, 4, 8 and 16 cells

  // Cell (x, y) holds the maximum of the square that begins there.
  struct Level {
    CellIndex first;
    std::int32_t width = 0;
    std::int32_t height = 0;
    std::vector<std::uint8_t> bytes;

    std::uint8_t At(std::int32_t x, std::int32_t y) const {
      const std::int32_t column = x - first.x;
      const std::int32_t row = y - first.y;
      if (column < 0 || row < 0 || column >= width || row >= height) {
        return 0;
      }
      return bytes[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                   static_cast<std::size_t>(column)];
    }
  };
  struct Node;
  class Run;

  std::vector<Level> levels_;
  double cell_size_m_;
};

}  // namespace loci
