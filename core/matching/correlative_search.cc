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

// std::floor as an integer, without the call that processors without SSE 4.1 need.
std::int32_t FloorToInt(double value) {
  const std::int32_t truncated = static_cast<std::int32_t>(value);
  return truncated - (value < truncated ? 1 : 0);
}

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
    cells.push_back({FloorToInt(moved.x()), FloorToInt(moved.y())});
  }
}

// The bytes that a search may touch, as a rectangle in which the window of every point that scores
// at all lies whole: the grid's own bytes if it is large enough, else a copy with zeros around.
class SearchedBytes {
 public:
  SearchedBytes(std::span<const Eigen::Vector2d> points,
                const Pose2& predicted,
                const Steps& steps,
                std::int32_t columns,
                const LikelihoodGrid& grid)
      : box_(grid.box()), stride_(grid.width()), columns_(columns), bytes_(grid.bytes()) {
    double reach_squared_m2 = 0.0;
    for (const Eigen::Vector2d& point : points) {
      reach_squared_m2 = std::max(reach_squared_m2, point.squaredNorm());
    }
    // Cells that a point can come into, one more for rounding, and the window around them.
    const double reach_m = std::sqrt(reach_squared_m2) + grid.cell_size_m();
    const CellIndex low = CellOf(predicted.translation().array() - reach_m, grid.cell_size_m());
    const CellIndex high = CellOf(predicted.translation().array() + reach_m, grid.cell_size_m());
    const CellBox touched{{low.x - steps.x, low.y - steps.y},
                          {high.x - steps.x + columns, high.y + steps.y + 1}};
    const bool is_large_enough = touched.min.x >= box_.min.x && touched.min.y >= box_.min.y &&
                                 touched.max.x <= box_.max.x && touched.max.y <= box_.max.y;
    if (!is_large_enough) {
      CopyPadded(touched, steps, grid);
    }
  }

  std::int32_t stride() const { return stride_; }

  // Where the window of a point at `cell` begins; null if no byte of it is above zero.
  const std::uint8_t* WindowAt(CellIndex cell, const Steps& steps) const {
    const std::int32_t x = cell.x - steps.x - box_.min.x;
    const std::int32_t y = cell.y - steps.y - box_.min.y;
    if (x < 0 || y < 0 || x + columns_ > stride_ || y + 2 * steps.y >= box_.max.y - box_.min.y) {
      return nullptr;
    }
    return bytes_ + static_cast<std::size_t>(y) * static_cast<std::size_t>(stride_) +
           static_cast<std::size_t>(x);
  }

 private:
  void CopyPadded(const CellBox& touched, const Steps& steps, const LikelihoodGrid& grid) {
    // A window that meets the grid begins at most its own size before it and ends as far behind.
    box_ = {{std::max(touched.min.x, box_.min.x - 2 * steps.x),
             std::max(touched.min.y, box_.min.y - 2 * steps.y)},
            {std::min(touched.max.x, box_.max.x + columns_),
             std::min(touched.max.y, box_.max.y + 2 * steps.y)}};
    if (box_.Empty()) {
      box_ = {};
    }
    stride_ = box_.max.x - box_.min.x;
    padded_.assign(
        static_cast<std::size_t>(stride_) * static_cast<std::size_t>(box_.max.y - box_.min.y) +
            kLanes,
        0);
    bytes_ = padded_.data();
    const std::int32_t x_first = std::max(box_.min.x, grid.box().min.x);
    const std::int32_t x_last = std::min(box_.max.x, grid.box().max.x);
    const std::int32_t y_first = std::max(box_.min.y, grid.box().min.y);
    const std::int32_t y_last = std::min(box_.max.y, grid.box().max.y);
    for (std::int32_t y = y_first; y < y_last && x_first < x_last; ++y) {
      const std::uint8_t* from =
          grid.bytes() +
          static_cast<std::size_t>(y - grid.box().min.y) * static_cast<std::size_t>(grid.width()) +
          static_cast<std::size_t>(x_first - grid.box().min.x);
      std::copy_n(from,
                  x_last - x_first,
                  padded_.begin() + static_cast<std::ptrdiff_t>(y - box_.min.y) * stride_ +
                      (x_first - box_.min.x));
    }
  }

  CellBox box_;
  std::int32_t stride_;
  std::int32_t columns_;  // of a window
  const std::uint8_t* bytes_;
  std::vector<std::uint8_t> padded_;
};

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
  // Penalties only grow with x and y, also as rounded, so this bounds every score of the heading.
  const std::uint32_t raw_max = *std::max_element(sums.begin(), sums.end());
  if (scale * raw_max - penalty.At(0, 0, theta) <= best.score) {
    return;
  }
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
  const SearchedBytes bytes(points_in_robot, predicted, steps, columns, grid);
  std::vector<CellIndex> cells;
  cells.reserve(points_in_robot.size());
  std::vector<const std::uint8_t*> windows;
  windows.reserve(points_in_robot.size());
  Best best;
  for (std::int32_t theta = -steps.theta; theta <= steps.theta; ++theta) {
    const Pose2 pose{
        predicted.x, predicted.y, WrapAngle(predicted.theta + theta * window.step_theta_rad)};
    RotateIntoCells(points_in_robot, pose, grid.cell_size_m(), cells);
    windows.clear();
    for (const CellIndex cell : cells) {
      if (const std::uint8_t* at = bytes.WindowAt(cell, steps); at != nullptr) {
        windows.push_back(at);
      }
    }
    std::fill(sums.begin(), sums.end(), 0U);
    AddRows(windows, bytes.stride(), rows, columns, sums.data());
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
