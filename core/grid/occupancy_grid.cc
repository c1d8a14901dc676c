// SPDX-License-Identifier: Apache-2.0
#include "core/grid/occupancy_grid.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

#include <emmintrin.h>

#include "core/base/math.h"

namespace loci {
namespace {

// Neighbouring readings that differ by more than this do not lie on one surface.
constexpr double kJumpM = 0.4;

std::int32_t FloorToCell(double value, double cell_size_m) {
  const double cells = value / cell_size_m;
  const std::int32_t truncated = static_cast<std::int32_t>(cells);
  return truncated - (cells < truncated ? 1 : 0);  // std::floor, without the call
}

// The border of free space as a polygon in units of cells, star-shaped around the scanner.
std::vector<Eigen::Vector2d> FreePolygon(const LaserScan& scan,
                                         const Pose2& grid_from_robot,
                                         double range_max_m,
                                         double cell_size_m) {
  const Pose2 grid_from_laser = grid_from_robot * scan.robot_from_laser;
  const Eigen::Vector2d center = grid_from_laser.translation() / cell_size_m;
  // Ends half a cell before the reading: the cell of the reading is not free.
  const auto free_range = [&](std::size_t beam) {
    const double range_m = 0.001 * scan.ranges_mm[beam];
    if (scan.ranges_mm[beam] == LaserScan::kNothingSeen || range_m < kRangeMinM) {
      return 0.0;
    }
    return std::max(0.0, std::min(range_m, range_max_m) / cell_size_m - 0.5);
  };
  const std::size_t count = scan.ranges_mm.size();
  const double span_rad = scan.angle_step_rad * static_cast<double>(count);
  const bool full_turn = span_rad >= 2.0 * kPi - 0.5 * scan.angle_step_rad;
  std::vector<Eigen::Vector2d> polygon;
  polygon.reserve(count + 16);
  const double jump = kJumpM / cell_size_m;
  // Turned from one half beam to the next: a few 1e-13 off after thousands of them, which no cell
  // notices, and no sine or cosine for each.
  const double first_rad = grid_from_laser.theta + scan.angle_min_rad;
  Eigen::Vector2d direction(Cos(first_rad), Sin(first_rad));
  const Transformer2 half_step({0.0, 0.0, 0.5 * scan.angle_step_rad});
  double range = count == 0 ? 0.0 : free_range(0);
  for (std::size_t beam = 0; beam < count; ++beam) {
    polygon.push_back(center + range * direction);
    direction = half_step.Rotate(direction);  // of the bisector
    if (beam + 1 == count && !full_turn) {
      continue;
    }
    const double next = free_range(beam + 1 == count ? 0 : beam + 1);
    if (std::abs(next - range) > jump) {
      polygon.push_back(center + std::min(range, next) * direction);
    }
    direction = half_step.Rotate(direction);
    range = next;
  }
  if (!full_turn) {
    polygon.push_back(center);
  }
  return polygon;
}

// One miss for sixteen cells: unobserved becomes 0 first; never below the clamp.
__m128i WithMiss(__m128i before) {
  // Saturation does the clamping: what would fall below the clamp sticks at -128 and is lifted to
  // it.
  constexpr int kLift = 128 - kPlaceLogOddsMax;
  const __m128i unobserved = _mm_set1_epi8(kUnobserved);
  const __m128i known = _mm_andnot_si128(_mm_cmpeq_epi8(before, unobserved), before);
  const __m128i sunk = _mm_subs_epi8(known, _mm_set1_epi8(kMissUnits + kLift));
  return _mm_adds_epi8(sunk, _mm_set1_epi8(kLift));
}

// Adds a miss to those of sixteen cells that lie in [first, last), counted from the first of them.
void AddMissesInside(LogOdds8* sixteen, std::int32_t first, std::int32_t last) {
  static constexpr std::array<LogOdds8, 48> kOnesInTheMiddle = [] {
    std::array<LogOdds8, 48> ones = {};
    std::fill(ones.begin() + 16, ones.begin() + 32, LogOdds8{-1});
    return ones;
  }();
  const auto load = [](const LogOdds8* from) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
  };
  const __m128i from_first = load(&kOnesInTheMiddle[static_cast<std::size_t>(16 - first)]);
  const __m128i before_last = load(&kOnesInTheMiddle[static_cast<std::size_t>(32 - last)]);
  const __m128i inside = _mm_and_si128(from_first, before_last);
  const __m128i before = load(sixteen);
  const __m128i after =
      _mm_or_si128(_mm_and_si128(inside, WithMiss(before)), _mm_andnot_si128(inside, before));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(sixteen), after);
}

// Adds one miss to cells [first, last) of a row of a block, sixteen at a time.
void AddMisses(LogOdds8* row, std::int32_t first, std::int32_t last) {
  std::int32_t x = first & ~15;
  if (x != first) {
    AddMissesInside(row + x, first - x, std::min(last - x, 16));
    x += 16;
  }
  for (; x + 16 <= last; x += 16) {
    __m128i* cells = reinterpret_cast<__m128i*>(row + x);
    _mm_storeu_si128(cells, WithMiss(_mm_loadu_si128(cells)));
  }
  if (x < last) {
    AddMissesInside(row + x, 0, last - x);
  }
}

void FillSpan(std::int32_t y, std::int32_t x_first, std::int32_t x_last, LogOddsGrid& grid) {
  while (x_first < x_last) {
    const std::int32_t block_x = x_first >> LogOddsGrid::kBlockBits;
    const std::int32_t block_end = std::min(x_last, (block_x + 1) << LogOddsGrid::kBlockBits);
    LogOddsGrid::Block& block = grid.WritableBlock({block_x, y >> LogOddsGrid::kBlockBits});
    LogOdds8* row = block.cells.data() + ((y & LogOddsGrid::kBlockMask) << LogOddsGrid::kBlockBits);
    const std::int32_t base = block_x << LogOddsGrid::kBlockBits;
    AddMisses(row, x_first - base, block_end - base);
    x_first = block_end;
  }
}

// The first cell whose centre, at cell + 0.5, is not below `value`.
std::int32_t FirstCenterFrom(double value) {
  const double shifted = value - 0.5;
  const std::int32_t truncated = static_cast<std::int32_t>(shifted);
  return truncated + (shifted > truncated ? 1 : 0);  // std::ceil, without the call
}

// Where the edges of a polygon cross the centres of rows, sorted by x in each row.
struct Crossings {
  std::int32_t first_row = 0;
  std::vector<std::size_t> row_ends;  // into `xs`; row i begins where row i - 1 ends
  std::vector<double> xs;
};

// Calls visit(low, high, first row, end of rows) for each edge that crosses a row.
template <typename Visit>
void ForEachCrossingEdge(std::span<const Eigen::Vector2d> polygon, Visit visit) {
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d* low = &polygon[i];
    const Eigen::Vector2d* high = &polygon[i + 1 == polygon.size() ? 0 : i + 1];
    if (low->y() > high->y()) {
      std::swap(low, high);
    }
    const std::int32_t first = FirstCenterFrom(low->y());
    const std::int32_t last = FirstCenterFrom(high->y());
    if (first < last) {
      visit(*low, *high, first, last);
    }
  }
}

// Sorts by insertion what is mostly two or four numbers.
void SortFew(std::span<double> values) {
  constexpr std::size_t kFew = 16;
  if (values.size() > kFew) {
    std::sort(values.begin(), values.end());
    return;
  }
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double value = values[i];
    std::size_t at = i;
    for (; at > 0 && values[at - 1] > value; --at) {
      values[at] = values[at - 1];
    }
    values[at] = value;
  }
}

// Sorted by counting: there are few crossings in a row.
Crossings FindCrossings(std::span<const Eigen::Vector2d> polygon) {
  Crossings crossings;
  const auto [lowest, highest] = std::minmax_element(
      polygon.begin(), polygon.end(), [](const auto& a, const auto& b) { return a.y() < b.y(); });
  crossings.first_row = FirstCenterFrom(lowest->y());
  const std::int32_t row_count = FirstCenterFrom(highest->y()) - crossings.first_row;
  crossings.row_ends.assign(static_cast<std::size_t>(std::max(row_count, 0)) + 1, 0);
  std::size_t* ends = crossings.row_ends.data();
  ForEachCrossingEdge(
      polygon, [&](const auto&, const auto&, std::int32_t first, std::int32_t last) {
        for (std::int32_t row = first - crossings.first_row; row < last - crossings.first_row;
             ++row) {
          ++ends[row + 1];
        }
      });
  std::partial_sum(
      crossings.row_ends.begin(), crossings.row_ends.end(), crossings.row_ends.begin());
  crossings.xs.resize(crossings.row_ends.back());
  // From here on ends[i] is where row i begins, and moves to its end as it is filled.
  ForEachCrossingEdge(
      polygon, [&](const auto& low, const auto& high, std::int32_t first, std::int32_t last) {
        const double slope = (high.x() - low.x()) / (high.y() - low.y());
        for (std::int32_t row = first; row < last; ++row) {
          crossings.xs[ends[row - crossings.first_row]++] = low.x() + (row + 0.5 - low.y()) * slope;
        }
      });
  crossings.row_ends.pop_back();
  std::size_t begin = 0;
  for (const std::size_t end : crossings.row_ends) {
    SortFew({crossings.xs.data() + begin, end - begin});
    begin = end;
  }
  return crossings;
}

// Cells whose centre lies in the polygon (even-odd rule) get a miss. Returns their number.
std::uint64_t FillPolygon(std::span<const Eigen::Vector2d> polygon, LogOddsGrid& grid) {
  if (polygon.empty()) {
    return 0;
  }
  const Crossings crossings = FindCrossings(polygon);
  std::uint64_t written = 0;
  std::size_t i = 0;
  std::int32_t row = crossings.first_row;
  for (const std::size_t end : crossings.row_ends) {
    LOCI_DCHECK((end - i) % 2 == 0);
    for (; i < end; i += 2) {
      const std::int32_t x_first = FirstCenterFrom(crossings.xs[i]);
      const std::int32_t x_last = FirstCenterFrom(crossings.xs[i + 1]);
      if (x_first < x_last) {
        FillSpan(row, x_first, x_last, grid);
        written += static_cast<std::uint64_t>(x_last - x_first);
      }
    }
    ++row;
  }
  return written;
}

// The cells of the points, each once, in the order of the points.
std::vector<CellIndex> DistinctCells(std::span<const Eigen::Vector2d> points_in_robot,
                                     const Pose2& grid_from_robot,
                                     double cell_size_m) {
  std::vector<CellIndex> cells;
  cells.reserve(points_in_robot.size());
  // An open hash table of positions in `cells`, plus one; at most half full.
  const std::size_t size = std::bit_ceil(2 * points_in_robot.size() + 2);
  std::vector<std::uint32_t> table(size, 0);
  const Transformer2 transform(grid_from_robot);
  for (const Eigen::Vector2d& point : points_in_robot) {
    const CellIndex cell = CellOf(transform * point, cell_size_m);
    const std::uint64_t key =
        (static_cast<std::uint64_t>(static_cast<std::uint32_t>(cell.y)) << 32U) |
        static_cast<std::uint32_t>(cell.x);
    std::size_t slot = static_cast<std::size_t>((key * 0x9E3779B97F4A7C15ULL) >> 32U) & (size - 1);
    while (table[slot] != 0 && cells[table[slot] - 1] != cell) {
      slot = (slot + 1) & (size - 1);
    }
    if (table[slot] == 0) {
      cells.push_back(cell);
      table[slot] = static_cast<std::uint32_t>(cells.size());
    }
  }
  return cells;
}

void AddHit(int units, LogOdds8& cell) {
  const int before = cell == kUnobserved ? 0 : cell;
  cell = static_cast<LogOdds8>(std::min(before + units, kPlaceLogOddsMax));
}

}  // namespace

CellIndex CellOf(const Eigen::Vector2d& point, double cell_size_m) {
  return {FloorToCell(point.x(), cell_size_m), FloorToCell(point.y(), cell_size_m)};
}

std::uint64_t IntegrateScan(const LaserScan& scan,
                            std::span<const Eigen::Vector2d> hits_in_robot,
                            const Pose2& grid_from_robot,
                            double range_max_m,
                            double cell_size_m,
                            LogOddsGrid& grid) {
  const std::vector<Eigen::Vector2d> polygon =
      FreePolygon(scan, grid_from_robot, range_max_m, cell_size_m);
  std::uint64_t written = FillPolygon(polygon, grid);
  for (const CellIndex cell : DistinctCells(hits_in_robot, grid_from_robot, cell_size_m)) {
    AddHit(kHitUnits, grid.Writable(cell));
    ++written;
  }
  return written;
}

std::uint64_t IntegrateMoving(std::span<const Eigen::Vector2d> points_in_robot,
                              const Pose2& grid_from_robot,
                              double cell_size_m,
                              LogOddsGrid& grid) {
  const std::vector<CellIndex> cells = DistinctCells(points_in_robot, grid_from_robot, cell_size_m);
  for (const CellIndex cell : cells) {
    AddHit(kHitUnits, grid.Writable(cell));
  }
  return cells.size();
}

}  // namespace loci
