// SPDX-License-Identifier: Apache-2.0
#include "core/matching/likelihood_grid.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

std::vector<CellIndex> RandomCells(RandomSequence& random, int count, std::int32_t reach) {
  std::vector<CellIndex> cells;
  for (int i = 0; i < count; ++i) {
    cells.push_back({static_cast<std::int32_t>(random.NextUniform(-reach, reach)),
                     static_cast<std::int32_t>(random.NextUniform(-reach, reach))});
  }
  return cells;
}

Patch PatchWith(const std::vector<CellIndex>& cells) {
  Patch patch;
  for (const CellIndex cell : cells) {
    patch.Add(0.05 * Eigen::Vector2d(cell.x + 0.5, cell.y + 0.5), PatchContent::kOwn);
  }
  return patch;
}

// The Gaussian of the nearest occupied cell within the square that the kernel covers.
std::uint8_t Plainly(const std::vector<CellIndex>& cells, CellIndex at) {
  double best = 0.0;
  for (const CellIndex cell : cells) {
    const std::int32_t dx = cell.x - at.x;
    const std::int32_t dy = cell.y - at.y;
    if (std::max(std::abs(dx), std::abs(dy)) <= LikelihoodGrid::kReachCells) {
      const double distance_m = 0.05 * std::hypot(dx, dy);
      best = std::max(best, std::exp(-0.5 * std::pow(distance_m / LikelihoodGrid::kSigmaM, 2.0)));
    }
  }
  return static_cast<std::uint8_t>(255.0 * best + 0.5);
}

TEST(LikelihoodGridTest, EveryByteIsTheGaussianOfTheNearestOccupiedCell) {
  RandomSequence random(1);
  const std::vector<CellIndex> cells = RandomCells(random, 60, 40);
  const LikelihoodGrid grid = LikelihoodGrid::OfPatch(PatchWith(cells), 1);
  for (std::int32_t y = -50; y < 50; ++y) {
    for (std::int32_t x = -50; x < 50; ++x) {
      ASSERT_EQ(grid.At({x, y}), Plainly(cells, {x, y})) << x << " " << y;
    }
  }
}

TEST(LikelihoodGridTest, GrowingCellByCellGivesTheGridOfThePatch) {
  RandomSequence random(2);
  for (int round = 0; round < 20; ++round) {
    const std::vector<CellIndex> cells = RandomCells(random, 100, 30 + 20 * round);
    const LikelihoodGrid whole = LikelihoodGrid::OfPatch(PatchWith(cells), 1);
    LikelihoodGrid grown({{-64, -64}, {64, 64}}, 0.05);
    for (const CellIndex cell : cells) {
      grown.Add(cell);
    }
    const CellBox box = whole.box();
    std::size_t differing = 0;
    for (std::int32_t y = box.min.y - 5; y < box.max.y + 5; ++y) {
      for (std::int32_t x = box.min.x - 5; x < box.max.x + 5; ++x) {
        differing += whole.At({x, y}) != grown.At({x, y}) ? 1U : 0U;
      }
    }
    EXPECT_EQ(differing, 0U) << round;
  }
}

TEST(LikelihoodGridTest, CellsWithTooFewHitsAreLeftOut) {
  Patch patch;
  patch.Add({0.01, 0.01}, PatchContent::kOwn);
  patch.Add({5.01, 0.01}, PatchContent::kOwn);
  patch.Add({5.02, 0.01}, PatchContent::kReference);
  const LikelihoodGrid grid = LikelihoodGrid::OfPatch(patch, 2);
  EXPECT_EQ(grid.At({0, 0}), 0);
  EXPECT_EQ(grid.At({100, 0}), 255);
}

TEST(LikelihoodGridTest, AnEmptyPatchMakesAGridWithoutAnything) {
  const LikelihoodGrid grid = LikelihoodGrid::OfPatch(Patch(), 1);
  EXPECT_EQ(grid.At({0, 0}), 0);
  EXPECT_EQ(grid.At({-1000000, 1000000}), 0);
}

TEST(LikelihoodGridTest, RowsCanBeReadInWholeRegistersToTheLastCell) {
  const LikelihoodGrid grid = LikelihoodGrid::OfPatch(PatchWith({{0, 0}}), 1);
  const std::size_t size = static_cast<std::size_t>(grid.width() * grid.height());
  for (std::size_t i = 0; i < 32; ++i) {
    EXPECT_EQ(grid.bytes()[size + i], 0);
  }
}

}  // namespace
}  // namespace loci
