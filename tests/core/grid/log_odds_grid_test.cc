// SPDX-License-Identifier: Apache-2.0
#include "core/grid/log_odds_grid.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/support/grids.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

using Cells = std::map<std::pair<std::int32_t, std::int32_t>, LogOdds8>;

CellIndex RandomCell(RandomSequence& random, std::int32_t reach) {
  return {static_cast<std::int32_t>(random.NextUniform(-reach, reach)),
          static_cast<std::int32_t>(random.NextUniform(-reach, reach))};
}

LogOdds8 RandomValue(RandomSequence& random) {
  return static_cast<LogOdds8>(random.NextUniform(-50.0, 50.0));
}

void ExpectHolds(const LogOddsGrid& grid, const Cells& cells) {
  EXPECT_EQ(ObservedCount(grid), cells.size());
  for (const auto& [cell, value] : cells) {
    EXPECT_EQ(grid.At({cell.first, cell.second}), value);
  }
}

std::string BytesOf(const LogOddsGrid& grid) {
  BinaryWriter writer;
  writer(grid);
  return writer.TakeBytes();
}

Status Read(std::string_view bytes, LogOddsGrid& grid) {
  BinaryReader reader(bytes);
  reader(grid);
  return reader.Finish("grid");
}

TEST(LogOddsGridTest, AnEmptyGridHasNothingAnywhere) {
  const LogOddsGrid grid;
  EXPECT_TRUE(grid.Bounds().Empty());
  EXPECT_EQ(grid.At({0, 0}), kUnobserved);
  EXPECT_EQ(grid.At({INT32_MIN, INT32_MAX}), kUnobserved);
  EXPECT_EQ(grid.BlockCount(), 0U);
}

TEST(LogOddsGridTest, HoldsWhatWasWrittenAlsoAtNegativeCellsHoweverItGrows) {
  RandomSequence random(1);
  LogOddsGrid grid;
  Cells cells;
  for (int i = 0; i < 4000; ++i) {
    const CellIndex cell = RandomCell(random, 1000);
    const LogOdds8 value = RandomValue(random);
    grid.Writable(cell) = value;
    cells[{cell.x, cell.y}] = value;
  }
  ExpectHolds(grid, cells);
  for (int i = 0; i < 4000; ++i) {
    const CellIndex cell = RandomCell(random, 1200);
    const auto found = cells.find({cell.x, cell.y});
    EXPECT_EQ(grid.At(cell), found == cells.end() ? kUnobserved : found->second);
  }
}

TEST(LogOddsGridTest, CellsAroundZeroAreDifferentCells) {
  LogOddsGrid grid;
  for (std::int32_t y = -2; y <= 1; ++y) {
    for (std::int32_t x = -2; x <= 1; ++x) {
      grid.Writable({x, y}) = static_cast<LogOdds8>(4 * y + x);
    }
  }
  for (std::int32_t y = -2; y <= 1; ++y) {
    for (std::int32_t x = -2; x <= 1; ++x) {
      EXPECT_EQ(grid.At({x, y}), 4 * y + x);
    }
  }
  EXPECT_EQ(grid.BlockCount(), 4U);
}

TEST(LogOddsGridTest, BoundsAreThoseOfTheBlocks) {
  LogOddsGrid grid;
  grid.Writable({-1, 63}) = 1;
  grid.Writable({70, 64}) = 1;
  EXPECT_EQ(grid.Bounds().min, (CellIndex{-64, 0}));
  EXPECT_EQ(grid.Bounds().max, (CellIndex{128, 128}));
}

TEST(LogOddsGridTest, SharedCopiesNeverChange) {
  RandomSequence random(2);
  LogOddsGrid grid;
  Cells cells;
  std::vector<std::pair<LogOddsGrid, Cells>> shared;
  for (int i = 0; i < 3000; ++i) {
    const CellIndex cell = RandomCell(random, 300);
    const LogOdds8 value = RandomValue(random);
    grid.Writable(cell) = value;
    cells[{cell.x, cell.y}] = value;
    if (i % 100 == 0) {
      shared.emplace_back(grid.Share(), cells);
    }
  }
  ExpectHolds(grid, cells);
  for (const auto& [copy, then] : shared) {
    ExpectHolds(copy, then);
  }
}

TEST(LogOddsGridTest, BlocksThatWereNotWrittenSinceStayShared) {
  LogOddsGrid grid;
  grid.Writable({0, 0}) = 1;
  grid.Writable({100, 0}) = 2;
  const LogOddsGrid first = grid.Share();
  const LogOddsGrid second = grid.Share();
  EXPECT_EQ(first.FindBlock({0, 0}), second.FindBlock({0, 0}));
  grid.Writable({0, 0}) = 3;
  EXPECT_NE(grid.FindBlock({0, 0}), first.FindBlock({0, 0}));
  EXPECT_EQ(grid.FindBlock({1, 0}), first.FindBlock({1, 0}));
  const LogOddsGrid::Block* own = grid.FindBlock({0, 0});
  grid.Writable({1, 0}) = 4;
  EXPECT_EQ(grid.FindBlock({0, 0}), own);  // copied once, not at every write
}

TEST(LogOddsGridTest, TheBytesDoNotDependOnHowTheGridGrew) {
  RandomSequence random(3);
  std::vector<std::pair<CellIndex, LogOdds8>> writes;
  for (int i = 0; i < 300; ++i) {
    writes.emplace_back(RandomCell(random, 500), LogOdds8{0});
    writes.back().second = static_cast<LogOdds8>(writes.back().first.x % 50);
  }
  LogOddsGrid forth;
  for (const auto& [cell, value] : writes) {
    forth.Writable(cell) = value;
  }
  LogOddsGrid back;
  for (auto write = writes.rbegin(); write != writes.rend(); ++write) {
    back.Writable(write->first) = write->second;
    const LogOddsGrid shared = back.Share();
  }
  EXPECT_EQ(BytesOf(forth), BytesOf(back));
}

TEST(LogOddsGridTest, WhatWasWrittenIsRead) {
  RandomSequence random(4);
  LogOddsGrid grid;
  for (int i = 0; i < 300; ++i) {
    grid.Writable(RandomCell(random, 500)) = RandomValue(random);
  }
  LogOddsGrid read;
  read.Writable({9999, 9999}) = 1;
  ASSERT_THAT(Read(BytesOf(grid), read), IsOk());
  EXPECT_EQ(BytesOf(read), BytesOf(grid));
  EXPECT_EQ(read.At({9999, 9999}), kUnobserved);
  ASSERT_THAT(Read(BytesOf(LogOddsGrid()), read), IsOk());
  EXPECT_TRUE(read.Bounds().Empty());
}

TEST(LogOddsGridTest, TruncatedBytesAreDataLoss) {
  LogOddsGrid grid;
  grid.Writable({0, 0}) = 1;
  grid.Writable({-500, 70}) = 1;
  const std::string bytes = BytesOf(grid);
  for (std::size_t size = 0; size < bytes.size(); size += size < 64 ? 1 : 61) {
    LogOddsGrid read;
    EXPECT_THAT(Read(std::string_view(bytes).substr(0, size), read),
                IsStatus(StatusCode::kDataLoss));
  }
}

// The bytes of a grid that claims `count` blocks and has those at the given places.
std::string HostileBytes(std::uint32_t count, const std::vector<CellIndex>& blocks) {
  BinaryWriter writer;
  writer(count);
  const std::string cells(LogOddsGrid::kBlockSide * LogOddsGrid::kBlockSide, '\0');
  for (const CellIndex block : blocks) {
    writer(block.x, block.y);
    writer.Raw(cells.data(), cells.size());
  }
  return writer.TakeBytes();
}

TEST(LogOddsGridTest, AnAbsurdNumberOfBlocksIsDataLossAtOnce) {
  LogOddsGrid read;
  EXPECT_THAT(Read(HostileBytes(0xFFFFFFFFU, {{0, 0}}), read), IsStatus(StatusCode::kDataLoss));
  EXPECT_LE(read.BlockCount(), 1U);
}

TEST(LogOddsGridTest, BlocksFarApartAreDataLossAndAllocateLittle) {
  for (const CellIndex far : {CellIndex{16384, 16384}, {1 << 30, 0}, {0, -(1 << 30)}}) {
    LogOddsGrid read;
    EXPECT_THAT(Read(HostileBytes(2, {{-16384, -16384}, far}), read),
                IsStatus(StatusCode::kDataLoss));
  }
}

TEST(LogOddsGridTest, BlocksTwiceOrOutOfOrderAreDataLoss) {
  for (const std::vector<CellIndex>& blocks :
       {std::vector<CellIndex>{{0, 0}, {0, 0}}, {{1, 0}, {0, 0}}, {{0, 1}, {1, 0}}}) {
    LogOddsGrid read;
    EXPECT_THAT(Read(HostileBytes(2, blocks), read), IsStatus(StatusCode::kDataLoss));
  }
}

}  // namespace
}  // namespace loci
