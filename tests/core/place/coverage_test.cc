// SPDX-License-Identifier: Apache-2.0
#include "core/place/coverage.h"

#include <string>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/grid/occupancy_grid.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

constexpr double kCellM = 0.05;

LogOddsGrid RandomGrid(RandomSequence& random) {
  LogOddsGrid grid;
  for (int i = 0; i < 30000; ++i) {
    grid.Writable({static_cast<std::int32_t>(random.NextUniform(-150.0, 60.0)),
                   static_cast<std::int32_t>(random.NextUniform(-70.0, 200.0))}) =
        static_cast<LogOdds8>(random.NextBits() % 5 == 0 ? 20 : -40);
  }
  return grid;
}

TEST(CoverageTest, ASquareIsObservedIfACellIsAndFreeIfAllCellsAre) {
  RandomSequence random(1);
  const LogOddsGrid grid = RandomGrid(random);
  const Coverage coverage = Coverage::OfGrid(grid, kCellM);
  std::size_t observed_count = 0;
  std::size_t free_count = 0;
  for (std::int32_t y = -110; y < 110; ++y) {
    for (std::int32_t x = -110; x < 110; ++x) {
      bool observed = false;
      bool free = true;
      for (std::int32_t k = 0; k < 4; ++k) {
        const LogOdds8 value = grid.At({2 * x + k % 2, 2 * y + k / 2});
        observed = observed || value != kUnobserved;
        free = free && value != kUnobserved && value <= kConfidentlyFreeUnits;
      }
      const Eigen::Vector2d center(0.1 * (x + 0.5), 0.1 * (y + 0.5));
      ASSERT_EQ(coverage.IsObserved(center), observed) << x << " " << y;
      ASSERT_EQ(coverage.IsFree(center), free) << x << " " << y;
      observed_count += observed ? 1U : 0U;
      free_count += free ? 1U : 0U;
    }
  }
  EXPECT_EQ(coverage.ObservedCenters().size(), observed_count);
  EXPECT_GT(free_count, 100U);
}

TEST(CoverageTest, FarAwayAndOfNothingNothingWasSeen) {
  const Coverage nothing = Coverage::OfGrid(LogOddsGrid(), kCellM);
  EXPECT_FALSE(nothing.IsObserved({0.0, 0.0}));
  EXPECT_TRUE(nothing.ObservedCenters().empty());
  RandomSequence random(2);
  const Coverage coverage = Coverage::OfGrid(RandomGrid(random), kCellM);
  EXPECT_FALSE(coverage.IsObserved({1000.0, -1000.0}));
  EXPECT_FALSE(coverage.IsFree({1000.0, -1000.0}));
}

TEST(CoverageTest, WhatWasWrittenIsReadAndDamageIsFound) {
  RandomSequence random(3);
  const Coverage coverage = Coverage::OfGrid(RandomGrid(random), kCellM);
  BinaryWriter writer;
  writer(coverage);
  const auto read = [](std::string_view bytes, Coverage& into) {
    BinaryReader reader(bytes);
    reader(into);
    return reader.Finish("coverage");
  };
  Coverage same;
  ASSERT_THAT(read(writer.bytes(), same), IsOk());
  EXPECT_EQ(same.ObservedCenters(), coverage.ObservedCenters());
  for (std::size_t size = 0; size < 100; ++size) {
    EXPECT_THAT(read(std::string_view(writer.bytes()).substr(0, size), same),
                IsStatus(StatusCode::kDataLoss));
  }
  // Width and height (after a size and two origins) are held to the bits that follow.
  for (std::size_t byte = 16; byte < 24; ++byte) {
    std::string damaged = writer.bytes();
    damaged[byte] ^= 0x40;
    EXPECT_THAT(read(damaged, same), IsStatus(StatusCode::kDataLoss)) << byte;
    EXPECT_TRUE(same.ObservedCenters().empty());
  }
}

}  // namespace
}  // namespace loci
