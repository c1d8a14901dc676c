// SPDX-License-Identifier: Apache-2.0
#include "core/grid/occupancy_grid.h"

#include <algorithm>
#include <cmath>

#include <emmintrin.h>

#include "core/base/math.h"

namespace loci {
namespace {

// Neighbouring readings that differ by more than this do not lie on one surface.
constexpr double kJumpM = 0.4;

std::int32_t FloorToCell(double value, double cell_size_m) {
  return static_cast<std::int32_t>(std::floor(value / cell_size_m));
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
  const double first_rad = grid_from_laser.theta + scan.angle_min_rad;
  const auto vertex = [&](double beam, double range) -> Eigen::Vector2d {
    const double angle_rad = first_rad + beam * scan.angle_step_rad;
    return center + range * Eigen::Vector2d(Cos(angle_rad), Sin(angle_rad));
  };

  const std::size_t count = scan.ranges_mm.size();
  const double span_rad = scan.angle_step_rad * static_cast<double>(count);
  const bool full_turn = span_rad >= 2.0 * kPi - 0.5 * scan.angle_step_rad;
  std::vector<Eigen::Vector2d> polygon;
  polygon.reserve(count + 16);
  const double jump = kJumpM / cell_size_m;
  for (std::size_t beam = 0; beam < count; ++beam) {
    const double range = free_range(beam);
    if (range > 0.0) {
      polygon.push_back(vertex(static_cast<double>(beam), range));
    } else {
      polygon.push_back(center);
    }
    if (beam + 1 == count && !full_turn) {
      continue;
    }
    const double next = free_range(beam + 1 == count ? 0 : beam + 1);
    if (std::abs(next - range) > jump) {
      const double nearer = std::min(range, next);
      const double bisector = static_cast<double>(beam) + 0.5;
      polygon.push_back(nearer > 0.0 ? vertex(bisector, nearer) : center);
    }
  }
  if (!full_turn) {
    polygon.push_back(center);
  }
  return polygon;
}

// Adds one miss to cells [first, last) of a row of a block: unobserved becomes 0 first; never below
// the clamp. Sixteen cells at a time; the masks select the cells at the ends.
void AddMisses(LogOdds8* row, std::int32_t first, std::int32_t last) {
  const __m128i unobserved = _mm_set1_epi8(kUnobserved);
  const __m128i miss = _mm_set1_epi8(kMissUnits);
  const __m128i low = _mm_set1_epi8(-kPlaceLogOddsMax);
  const __m128i lane = _mm_setr_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  for (std::int32_t x = first & ~15; x < last; x += 16) {
    __m128i* cells = reinterpret_cast<__m128i*>(row + x);
    const __m128i before = _mm_loadu_si128(cells);
    __m128i after = _mm_andnot_si128(_mm_cmpeq_epi8(before, unobserved), before);
    after = _mm_subs_epi8(after, miss);
    const __m128i above = _mm_cmpgt_epi8(after, low);
    after = _mm_or_si128(_mm_and_si128(above, after), _mm_andnot_si128(above, low));
    const __m128i from = _mm_set1_epi8(static_cast<char>(std::clamp(first - x, -1, 16)));
    const __m128i to = _mm_set1_epi8(static_cast<char>(std::clamp(last - x, -1, 16)));
    const __m128i inside = _mm_andnot_si128(_mm_cmpgt_epi8(from, lane), _mm_cmpgt_epi8(to, lane));
    after = _mm_or_si128(_mm_and_si128(inside, after), _mm_andnot_si128(inside, before));
    _mm_storeu_si128(cells, after);
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

struct Crossing {
  std::int32_t row;
  double x;
};

// Cells whose centre lies in the polygon (even-odd rule) get a miss. Returns their number.
std::uint64_t FillPolygon(std::span<const Eigen::Vector2d> polygon, LogOddsGrid& grid) {
  std::vector<Crossing> crossings;
  crossings.reserve(polygon.size() * 8);
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    Eigen::Vector2d a = polygon[i];
    Eigen::Vector2d b = polygon[i + 1 == polygon.size() ? 0 : i + 1];
    if (a.y() > b.y()) {
      std::swap(a, b);
    }
    // Rows whose centre y + 0.5 lies in [a.y, b.y).
    const std::int32_t first = static_cast<std::int32_t>(std::ceil(a.y() - 0.5));
    const std::int32_t last = static_cast<std::int32_t>(std::ceil(b.y() - 0.5));
    if (first >= last) {
      continue;
    }
    const double slope = (b.x() - a.x()) / (b.y() - a.y());
    for (std::int32_t row = first; row < last; ++row) {
      crossings.push_back({row, a.x() + (row + 0.5 - a.y()) * slope});
    }
  }
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return a.row != b.row ? a.row < b.row : a.x < b.x;
  });
  std::uint64_t written = 0;
  for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
    LOCI_DCHECK(crossings[i].row == crossings[i + 1].row);
    const std::int32_t x_first = static_cast<std::int32_t>(std::ceil(crossings[i].x - 0.5));
    const std::int32_t x_last = static_cast<std::int32_t>(std::ceil(crossings[i + 1].x - 0.5));
    if (x_first < x_last) {
      FillSpan(crossings[i].row, x_first, x_last, grid);
      written += static_cast<std::uint64_t>(x_last - x_first);
    }
  }
  return written;
}

std::vector<CellIndex> DistinctCells(std::span<const Eigen::Vector2d> points_in_robot,
                                     const Pose2& grid_from_robot,
                                     double cell_size_m) {
  std::vector<CellIndex> cells;
  cells.reserve(points_in_robot.size());
  const Transformer2 transform(grid_from_robot);
  for (const Eigen::Vector2d& point : points_in_robot) {
    cells.push_back(CellOf(transform * point, cell_size_m));
  }
  std::sort(cells.begin(), cells.end(), [](CellIndex a, CellIndex b) {
    return a.y != b.y ? a.y < b.y : a.x < b.x;
  });
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
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
