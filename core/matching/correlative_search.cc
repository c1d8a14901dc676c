// SPDX-License-Identifier: Apache-2.0
#include "core/matching/correlative_search.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <immintrin.h>

#include "core/base/check.h"
#include "core/grid/occupancy_grid.h"

namespace loci {
namespace {

// Translations are scored sixteen columns at a time.
constexpr std::int32_t kLanes = 16;
// Sums of bytes are kept in 16 bits; after this many points they are carried over into 32.
constexpr std::size_t kPointsPerCarry = 256;

// The window in whole steps: offsets run from -half to +half.
struct Steps {
  std::int32_t x;
  std::int32_t y;
  std::int32_t theta;
};

Steps StepsOf(const SearchWindow& window, double cell_size_m) {
  const auto count = [](double half, double step) {
    return static_cast<std::int32_t>(std::floor(half / step + 1e-9));
  };
  return {count(window.half_x_m, cell_size_m),
          count(window.half_y_m, cell_size_m),
          count(window.half_theta_rad, window.step_theta_rad)};
}

double Square(double value) {
  return value * value;
}

// The penalty of an offset: border_penalty at a corner's distance in each direction.
class Penalty {
 public:
  Penalty(const SearchWindow& window, const Steps& steps)
      : weight_x_(window.border_penalty / Square(std::max(steps.x, 1))),
        weight_y_(window.border_penalty / Square(std::max(steps.y, 1))),
        weight_theta_(window.border_penalty / Square(std::max(steps.theta, 1))) {}

  double At(std::int32_t x, std::int32_t y, std::int32_t theta) const {
    return weight_x_ * (x * x) + weight_y_ * (y * y) + weight_theta_ * (theta * theta);
  }

 private:
  double weight_x_;
  double weight_y_;
  double weight_theta_;
};

// Cells of the points at one heading, for the translation of the prediction.
void RotateIntoCells(std::span<const Eigen::Vector2d> points,
                     const Pose2& pose,
                     double cell_size_m,
                     std::vector<CellIndex>& cells) {
  const Transformer2 transform(pose);
  const double scale = 1.0 / cell_size_m;
  cells.clear();
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d moved = scale * (transform * point);
    cells.push_back({static_cast<std::int32_t>(std::floor(moved.x())),
                     static_cast<std::int32_t>(std::floor(moved.y()))});
  }
}

// Where a point's window of translations begins in the grid's bytes, for those whose whole window
// lies inside; the others are `border` points and are looked up one by one.
struct Placement {
  std::vector<const std::uint8_t*> inside;
  std::vector<CellIndex> border;
};

void Place(std::span<const CellIndex> cells,
           const Steps& steps,
           std::int32_t columns,
           const LikelihoodGrid& grid,
           Placement& placement) {
  placement.inside.clear();
  placement.border.clear();
  for (const CellIndex cell : cells) {
    const std::int32_t x = cell.x - steps.x - grid.box().min.x;
    const std::int32_t y = cell.y - steps.y - grid.box().min.y;
    const bool outside =
        x + 2 * steps.x < 0 || y + 2 * steps.y < 0 || x >= grid.width() || y >= grid.height();
    if (outside) {
      continue;  // scores nothing anywhere in the window
    }
    if (x >= 0 && y >= 0 && x + columns <= grid.width() && y + 2 * steps.y < grid.height()) {
      placement.inside.push_back(
          grid.bytes() + static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width()) +
          static_cast<std::size_t>(x));
    } else {
      placement.border.push_back(cell);
    }
  }
}

using Sums = std::vector<std::uint32_t>;  // rows of `columns` sums, one per translation

void AddRowsScalar(std::span<const std::uint8_t* const> starts,
                   std::int32_t stride,
                   std::int32_t rows,
                   std::int32_t columns,
                   std::uint32_t* sums) {
  for (const std::uint8_t* start : starts) {
    for (std::int32_t row = 0; row < rows; ++row) {
      for (std::int32_t column = 0; column < columns; ++column) {
        sums[row * columns + column] += start[row * stride + column];
      }
    }
  }
}

// One row of sixteen translations over all points: the row's sums stay in one register.
__attribute__((target("avx2"))) void AddRowAvx2(std::span<const std::uint8_t* const> starts,
                                                std::ptrdiff_t offset,
                                                std::uint32_t* sums) {
  for (std::size_t first = 0; first < starts.size(); first += kPointsPerCarry) {
    const std::size_t last = std::min(starts.size(), first + kPointsPerCarry);
    __m256i sum = _mm256_setzero_si256();
    for (std::size_t i = first; i < last; ++i) {
      const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(starts[i] + offset));
      sum = _mm256_add_epi16(sum, _mm256_cvtepu8_epi16(bytes));
    }
    __m256i* out = reinterpret_cast<__m256i*>(sums);
    const __m256i low = _mm256_cvtepu16_epi32(_mm256_castsi256_si128(sum));
    const __m256i high = _mm256_cvtepu16_epi32(_mm256_extracti128_si256(sum, 1));
    _mm256_storeu_si256(out, _mm256_add_epi32(_mm256_loadu_si256(out), low));
    _mm256_storeu_si256(out + 1, _mm256_add_epi32(_mm256_loadu_si256(out + 1), high));
  }
}

void AddRows(std::span<const std::uint8_t* const> starts,
             std::int32_t stride,
             std::int32_t rows,
             std::int32_t columns,
             std::uint32_t* sums) {
  static const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
  if (!has_avx2) {
    AddRowsScalar(starts, stride, rows, columns, sums);
    return;
  }
  for (std::int32_t row = 0; row < rows; ++row) {
    for (std::int32_t column = 0; column < columns; column += kLanes) {
      AddRowAvx2(starts,
                 static_cast<std::ptrdiff_t>(row) * stride + column,
                 sums + row * columns + column);
    }
  }
}

// Points near the border of the grid, looked up one by one; bytes outside count 0.
void AddBorder(std::span<const CellIndex> cells,
               const Steps& steps,
               std::int32_t columns,
               const LikelihoodGrid& grid,
               Sums& sums) {
  for (const CellIndex cell : cells) {
    for (std::int32_t row = 0; row <= 2 * steps.y; ++row) {
      for (std::int32_t column = 0; column <= 2 * steps.x; ++column) {
        sums[static_cast<std::size_t>(row * columns + column)] +=
            grid.At({cell.x - steps.x + column, cell.y - steps.y + row});
      }
    }
  }
}

// The best of one heading's translations is kept if it is better than what there was.
struct Best {
  double score = -1e300;
  double likelihood = 0.0;
  std::uint32_t raw = 0;
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t theta = 0;
};

void KeepBest(const Sums& sums,
              std::int32_t columns,
              const Steps& steps,
              const Penalty& penalty,
              double scale,
              std::int32_t theta,
              Best& best) {
  for (std::int32_t y = -steps.y; y <= steps.y; ++y) {
    for (std::int32_t x = -steps.x; x <= steps.x; ++x) {
      const std::uint32_t raw =
          sums[static_cast<std::size_t>((y + steps.y) * columns + x + steps.x)];
      const double likelihood = scale * raw;
      const double score = likelihood - penalty.At(x, y, theta);
      if (score > best.score) {
        best = {score, likelihood, raw, x, y, theta};
      }
    }
  }
}

CorrelativeMatch MatchOf(const Best& best,
                         const Pose2& predicted,
                         const SearchWindow& window,
                         double cell_size_m) {
  return {{predicted.x + best.x * cell_size_m,
           predicted.y + best.y * cell_size_m,
           WrapAngle(predicted.theta + best.theta * window.step_theta_rad)},
          best.score,
          best.likelihood,
          best.raw};
}

double ScaleOf(std::size_t point_count) {
  return 1.0 / (255.0 * static_cast<double>(std::max<std::size_t>(point_count, 1)));
}

}  // namespace

CorrelativeMatch FindBestPose(std::span<const Eigen::Vector2d> points_in_robot,
                              const Pose2& predicted,
                              const SearchWindow& window,
                              const LikelihoodGrid& grid) {
  const Steps steps = StepsOf(window, grid.cell_size_m());
  const std::int32_t columns = (2 * steps.x + kLanes) / kLanes * kLanes;  // 2 x + 1, rounded up
  const std::int32_t rows = 2 * steps.y + 1;
  const Penalty penalty(window, steps);
  const double scale = ScaleOf(points_in_robot.size());
  Sums sums(static_cast<std::size_t>(rows * columns));
  std::vector<CellIndex> cells;
  cells.reserve(points_in_robot.size());
  Placement placement;
  Best best;
  for (std::int32_t theta = -steps.theta; theta <= steps.theta; ++theta) {
    const Pose2 pose{
        predicted.x, predicted.y, WrapAngle(predicted.theta + theta * window.step_theta_rad)};
    RotateIntoCells(points_in_robot, pose, grid.cell_size_m(), cells);
    Place(cells, steps, columns, grid, placement);
    std::fill(sums.begin(), sums.end(), 0U);
    AddRows(placement.inside, grid.width(), rows, columns, sums.data());
    AddBorder(placement.border, steps, columns, grid, sums);
    KeepBest(sums, columns, steps, penalty, scale, theta, best);
  }
  return MatchOf(best, predicted, window, grid.cell_size_m());
}

CorrelativeMatch FindBestPosePlainly(std::span<const Eigen::Vector2d> points_in_robot,
                                     const Pose2& predicted,
                                     const SearchWindow& window,
                                     const LikelihoodGrid& grid) {
  const Steps steps = StepsOf(window, grid.cell_size_m());
  const Penalty penalty(window, steps);
  const double scale = ScaleOf(points_in_robot.size());
  std::vector<CellIndex> cells;
  Best best;
  for (std::int32_t theta = -steps.theta; theta <= steps.theta; ++theta) {
    const Pose2 pose{
        predicted.x, predicted.y, WrapAngle(predicted.theta + theta * window.step_theta_rad)};
    RotateIntoCells(points_in_robot, pose, grid.cell_size_m(), cells);
    for (std::int32_t y = -steps.y; y <= steps.y; ++y) {
      for (std::int32_t x = -steps.x; x <= steps.x; ++x) {
        std::uint32_t raw = 0;
        for (const CellIndex cell : cells) {
          raw += grid.At({cell.x + x, cell.y + y});
        }
        const double likelihood = scale * raw;
        const double score = likelihood - penalty.At(x, y, theta);
        if (score > best.score) {
          best = {score, likelihood, raw, x, y, theta};
        }
      }
    }
  }
  return MatchOf(best, predicted, window, grid.cell_size_m());
}

double CorrelationAt(std::span<const Eigen::Vector2d> points_in_robot,
                     const Pose2& grid_from_robot,
                     const LikelihoodGrid& grid) {
  const Transformer2 transform(grid_from_robot);
  std::uint64_t sum = 0;
  for (const Eigen::Vector2d& point : points_in_robot) {
    sum += grid.At(CellOf(transform * point, grid.cell_size_m()));
  }
  return ScaleOf(points_in_robot.size()) * static_cast<double>(sum);
}

}  // namespace loci
