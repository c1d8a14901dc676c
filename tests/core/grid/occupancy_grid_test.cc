// SPDX-License-Identifier: Apache-2.0
#include "core/grid/occupancy_grid.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/generator.h"
#include "tests/support/grids.h"

namespace loci {
namespace {

constexpr double kCellM = 0.05;
constexpr double kRangeMaxM = 15.0;
constexpr double kJumpM = 0.4;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Free range of a beam in cells: half a cell short of its reading.
double FreeRange(const LaserScan& scan, std::size_t beam) {
  const double range_m = 0.001 * scan.ranges_mm[beam];
  if (scan.ranges_mm[beam] == LaserScan::kNothingSeen || range_m < kRangeMinM) {
    return 0.0;
  }
  return std::max(0.0, std::min(range_m, kRangeMaxM) / kCellM - 0.5);
}

// Which side of the chord between two rays a point lies on: below 0 is the scanner's. The chord
// joins (range_a, angle_a) with (range_b, angle_b), in cells around the scanner.
double BeyondChord(
    const Eigen::Vector2d& point, double range_a, double angle_a, double range_b, double angle_b) {
  const Eigen::Vector2d a(range_a * std::cos(angle_a), range_a * std::sin(angle_a));
  const Eigen::Vector2d b(range_b * std::cos(angle_b), range_b * std::sin(angle_b));
  const double length = (b - a).norm();
  if (range_a == 0.0 || range_b == 0.0 || length < 1e-12) {
    return 1.0;  // a sector without area
  }
  return -Cross(b - a, point - a) / length;
}

// The plain rule, cell by cell: true if the cell's centre lies in free space, nothing if it lies so
// near to the border that rounding decides.
std::optional<bool> IsFreePlainly(const LaserScan& scan,
                                  const Pose2& grid_from_laser,
                                  CellIndex cell) {
  const Eigen::Vector2d center(cell.x + 0.5, cell.y + 0.5);
  const Eigen::Vector2d offset = center - grid_from_laser.translation() / kCellM;
  const std::size_t count = scan.ranges_mm.size();
  double angle = std::atan2(offset.y(), offset.x()) - grid_from_laser.theta - scan.angle_min_rad;
  angle -= 2.0 * kPi * std::floor(angle / (2.0 * kPi));
  const double beam = angle / scan.angle_step_rad;
  const std::size_t low = static_cast<std::size_t>(beam);
  const bool full_turn =
      scan.angle_step_rad * static_cast<double>(count) > 2.0 * kPi - 0.5 * scan.angle_step_rad;
  if (std::abs(beam - std::round(beam)) < 1e-6 || std::abs(beam - std::floor(beam) - 0.5) < 1e-6) {
    return std::nullopt;
  }
  if (low >= count || (low + 1 >= count && !full_turn)) {
    return false;
  }
  const Eigen::Vector2d point = offset.norm() * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  const double here = FreeRange(scan, low);
  const double next = FreeRange(scan, (low + 1) % count);
  const double here_angle = static_cast<double>(low) * scan.angle_step_rad;
  const double next_angle = here_angle + scan.angle_step_rad;
  double beyond = 0.0;
  if (std::abs(next - here) <= kJumpM / kCellM) {
    beyond = BeyondChord(point, here, here_angle, next, next_angle);
  } else {
    // Up to the bisector the chord leads to the nearer range, from there on it leaves from it.
    const double nearer = std::min(here, next);
    const double middle = here_angle + 0.5 * scan.angle_step_rad;
    beyond = angle < middle ? BeyondChord(point, here, here_angle, nearer, middle)
                            : BeyondChord(point, nearer, middle, next, next_angle);
  }
  if (std::abs(beyond) < 1e-6) {
    return std::nullopt;
  }
  return beyond < 0.0;
}

std::vector<Eigen::Vector2d> HitsOf(const LaserScan& scan) {
  std::vector<Eigen::Vector2d> hits;
  for (const ScanPoint& point : ToPoints(scan, kRangeMaxM)) {
    hits.push_back(point.point_in_robot);
  }
  return hits;
}

void ExpectEqualsReference(const LaserScan& scan, const Pose2& grid_from_robot) {
  const std::vector<Eigen::Vector2d> hits = HitsOf(scan);
  LogOddsGrid grid;
  const std::uint64_t written =
      IntegrateScan(scan, hits, grid_from_robot, kRangeMaxM, kCellM, grid);
  std::set<std::pair<std::int32_t, std::int32_t>> hit_cells;
  for (const Eigen::Vector2d& hit : hits) {
    const CellIndex cell = CellOf(grid_from_robot * hit, kCellM);
    hit_cells.insert({cell.x, cell.y});
  }
  const Pose2 grid_from_laser = grid_from_robot * scan.robot_from_laser;
  const CellIndex center = CellOf(grid_from_laser.translation(), kCellM);
  constexpr std::int32_t kReach = static_cast<std::int32_t>(kRangeMaxM / kCellM) + 2;
  std::size_t differing = 0;
  std::size_t undecided = 0;
  std::uint64_t free_count = 0;
  for (std::int32_t y = center.y - kReach; y <= center.y + kReach; ++y) {
    for (std::int32_t x = center.x - kReach; x <= center.x + kReach; ++x) {
      const std::optional<bool> free = IsFreePlainly(scan, grid_from_laser, {x, y});
      if (!free.has_value()) {
        ++undecided;
        continue;
      }
      free_count += *free ? 1U : 0U;
      const bool hit = hit_cells.contains({x, y});
      const int expected = (*free ? -kMissUnits : 0) + (hit ? kHitUnits : 0);
      const int found = grid.At({x, y});
      differing += found != (*free || hit ? expected : kUnobserved) ? 1U : 0U;
    }
  }
  EXPECT_EQ(differing, 0U);
  EXPECT_LE(undecided, 700U);  // cells on the rays themselves, of robots on the lattice
  EXPECT_GE(written, free_count + hit_cells.size());
  EXPECT_LE(written, free_count + hit_cells.size() + undecided);
}

TEST(OccupancyGridTest, IntegrationEqualsThePlainRuleInARoom) {
  const SimulatedWorld world = FurnishedRoom();
  RandomSequence random(1);
  for (const std::size_t beams : {std::size_t{181}, std::size_t{361}}) {
    Scanner scanner;
    scanner.beam_count = beams;
    scanner.angle_step_rad = kPi / static_cast<double>(beams - 1);
    scanner.robot_from_laser = {0.2, 0.05, 0.1};
    const Pose2 pose{random.NextUniform(-1.0, 1.0), random.NextUniform(-1.0, 1.0), 2.0};
    ExpectEqualsReference(world.Scan(pose, scanner, random), pose);
  }
}

TEST(OccupancyGridTest, IntegrationEqualsThePlainRuleForAFullTurn) {
  const SimulatedWorld world = FurnishedRoom();
  RandomSequence random(2);
  const Pose2 pose{0.4, -0.7, -2.5};
  ExpectEqualsReference(world.Scan(pose, FullTurnScanner(360), random), pose);
}

TEST(OccupancyGridTest, IntegrationEqualsThePlainRuleForWildRanges) {
  RandomSequence random(3);
  for (int round = 0; round < 4; ++round) {
    LaserScan scan;
    const bool full_turn = round % 2 == 1;
    scan.angle_min_rad = -2.0;
    scan.angle_step_rad = full_turn ? 2.0 * kPi / 90.0 : 0.04;
    for (int beam = 0; beam < 90; ++beam) {
      const std::uint64_t kind = random.NextBits() % 8;
      const double range_mm = random.NextUniform(0.0, 20000.0);
      scan.ranges_mm.push_back(kind == 0 ? LaserScan::kNothingSeen
                                         : static_cast<std::uint16_t>(range_mm));
    }
    const Pose2 pose{random.NextUniform(-9.0, 9.0), random.NextUniform(-9.0, 9.0), 1.0};
    ExpectEqualsReference(scan, pose);
  }
}

// One scan of beams at 1 degree, all of the given range, but for some of them.
LaserScan Fan(std::size_t beams, std::uint16_t range_mm) {
  LaserScan scan;
  scan.angle_min_rad = -0.5 * kPi;
  scan.angle_step_rad = kPi / 180.0;
  scan.ranges_mm.assign(beams, range_mm);
  return scan;
}

TEST(OccupancyGridTest, BehindTheNearerOfTwoReadingsNothingIsFreed) {
  LaserScan scan = Fan(181, 4000);
  scan.ranges_mm[90] = 1000;  // straight ahead
  LogOddsGrid grid;
  IntegrateScan(scan, {}, {}, kRangeMaxM, kCellM, grid);
  for (double x = 3.0; x < 3.8; x += 0.05) {
    EXPECT_EQ(grid.At(CellOf({x, 0.01}, kCellM)), kUnobserved) << x;
  }
  EXPECT_EQ(grid.At(CellOf({0.5, 0.01}, kCellM)), -kMissUnits);
  EXPECT_EQ(grid.At(CellOf({3.0, 1.0}, kCellM)), -kMissUnits);
}

TEST(OccupancyGridTest, TheSeamOfAFullTurnIsLikeEveryOtherPlace) {
  // Beam 0 looks along 0; the last one is its neighbour and sees much further.
  LaserScan scan;
  scan.angle_step_rad = 2.0 * kPi / 90.0;
  scan.ranges_mm.assign(90, 8000);
  scan.ranges_mm[0] = 1000;
  scan.ranges_mm[1] = 1000;
  LogOddsGrid grid;
  IntegrateScan(scan, {}, {}, kRangeMaxM, kCellM, grid);
  const double before_bisector_rad = -0.4 * scan.angle_step_rad;
  for (double range_m = 1.3; range_m < 8.0; range_m += 0.1) {
    const Eigen::Vector2d point(range_m * std::cos(before_bisector_rad),
                                range_m * std::sin(before_bisector_rad));
    EXPECT_EQ(grid.At(CellOf(point, kCellM)), kUnobserved) << range_m;
  }
}

TEST(OccupancyGridTest, BeamsThatSawNothingFreeNothing) {
  LaserScan scan = Fan(181, LaserScan::kNothingSeen);
  LogOddsGrid grid;
  EXPECT_EQ(IntegrateScan(scan, {}, {}, kRangeMaxM, kCellM, grid), 0U);
  scan = Fan(181, 20);  // dirt on the window
  EXPECT_EQ(IntegrateScan(scan, {}, {}, kRangeMaxM, kCellM, grid), 0U);
  EXPECT_EQ(ObservedCount(grid), 0U);
}

TEST(OccupancyGridTest, FreeSpaceEndsAtTheRangeLimit) {
  LogOddsGrid grid;
  IntegrateScan(Fan(181, 40000), {}, {}, 5.0, kCellM, grid);
  EXPECT_EQ(grid.At(CellOf({4.9, 0.01}, kCellM)), -kMissUnits);
  EXPECT_EQ(grid.At(CellOf({5.1, 0.01}, kCellM)), kUnobserved);
}

TEST(OccupancyGridTest, EvidenceIsClampedOnBothSides) {
  const std::vector<Eigen::Vector2d> hits = {{2.01, 0.01}};
  LogOddsGrid grid;
  for (int i = 0; i < 20; ++i) {
    IntegrateScan(Fan(181, 2000), hits, {}, kRangeMaxM, kCellM, grid);
  }
  EXPECT_EQ(grid.At(CellOf({2.01, 0.01}, kCellM)), kPlaceLogOddsMax);
  EXPECT_EQ(grid.At(CellOf({1.0, 0.01}, kCellM)), -kPlaceLogOddsMax);
}

TEST(OccupancyGridTest, ThreeScansThatSawNothingMakeACellConfidentlyFree) {
  LogOddsGrid grid;
  const CellIndex cell = CellOf({1.0, 0.01}, kCellM);
  for (int scans = 1; scans <= 3; ++scans) {
    IntegrateScan(Fan(181, 2000), {}, {}, kRangeMaxM, kCellM, grid);
    EXPECT_EQ(grid.At(cell) <= kConfidentlyFreeUnits, scans == 3);
  }
}

TEST(OccupancyGridTest, ThreeContraryScansFreeACellThatWasHitOnce) {
  LogOddsGrid grid;
  const CellIndex cell = CellOf({1.0, 0.01}, kCellM);
  IntegrateMoving(std::vector<Eigen::Vector2d>{{1.0, 0.01}}, {}, kCellM, grid);
  EXPECT_EQ(grid.At(cell), kHitUnits);
  for (int i = 0; i < 3; ++i) {
    EXPECT_GT(grid.At(cell), 0);
    IntegrateScan(Fan(181, 2000), {}, {}, kRangeMaxM, kCellM, grid);
  }
  EXPECT_LT(grid.At(cell), 0);
}

TEST(OccupancyGridTest, ManyPointsInOneCellAreOneHit) {
  LogOddsGrid grid;
  const std::vector<Eigen::Vector2d> points = {{1.01, 0.01}, {1.02, 0.02}, {1.04, 0.04}};
  EXPECT_EQ(IntegrateMoving(points, {}, kCellM, grid), 1U);
  EXPECT_EQ(grid.At(CellOf(points[0], kCellM)), kHitUnits);
}

TEST(OccupancyGridTest, CellsBelowZeroAreNotThoseAboveIt) {
  EXPECT_EQ(CellOf({-0.01, -0.06}, 0.05), (CellIndex{-1, -2}));
  EXPECT_EQ(CellOf({0.0, 0.049}, 0.05), (CellIndex{0, 0}));
}

}  // namespace
}  // namespace loci
