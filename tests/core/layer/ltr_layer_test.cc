// SPDX-License-Identifier: Apache-2.0
#include "core/layer/ltr_layer.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

const LtrLayout kLayout(7, 5);

LtrContribution RandomContribution(RandomSequence& random, std::uint32_t place) {
  LtrContribution contribution;
  contribution.place.value = place;
  contribution.session.value = place / 3;
  contribution.stamp_ns = static_cast<std::int64_t>(random.NextBits() % 1000);
  contribution.corners_in_place = {
      Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)};
  for (std::size_t i = 0; i < kLayout.cell_count(); ++i) {
    const bool seen = random.NextBits() % 3 != 0;
    contribution.cells.push_back(
        seen ? static_cast<LogOdds8>(static_cast<int>(random.NextBits() % 101) - 50) : kUnobserved);
  }
  return contribution;
}

std::string BytesOf(const LtrLayer& layer) {
  BinaryWriter writer;
  LtrLayer copy = layer;
  copy.VisitFields(writer);
  return writer.TakeBytes();
}

TEST(LtrLayoutTest, HoldsEveryCellThatTouchesTheTriangleAndLittleMore) {
  RandomSequence random(1);
  for (int round = 0; round < 200; ++round) {
    const auto columns = static_cast<std::int32_t>(1 + random.NextBits() % 40);
    const auto rows = static_cast<std::int32_t>(1 + random.NextBits() % 40);
    const LtrLayout layout(columns, rows);
    std::size_t touching = 0;
    for (std::int32_t row = 0; row < rows; ++row) {
      for (std::int32_t column = 0; column < columns; ++column) {
        if (column * rows + row * columns < columns * rows) {
          ++touching;
          ASSERT_LT(column, layout.RowSize(row));
        }
      }
      ASSERT_LE(layout.RowSize(row), columns);
    }
    EXPECT_LE(layout.cell_count(), touching + static_cast<std::size_t>(rows));
  }
}

TEST(LtrLayerTest, ServesTheClampedSumOfBaseAndContributions) {
  RandomSequence random(2);
  LtrLayer layer(kLayout.cell_count());
  std::vector<LtrContribution> all;
  for (std::uint32_t place = 0; place < 8; ++place) {
    all.push_back(RandomContribution(random, place));
    layer.Add(all.back());
  }
  const auto texture = layer.Texture(kLayout);
  ASSERT_EQ(texture->column_count, 7);
  ASSERT_EQ(texture->row_count, 5);
  ASSERT_EQ(texture->cells.size(), 35U);
  for (std::int32_t row = 0; row < 5; ++row) {
    for (std::int32_t column = 0; column < 7; ++column) {
      const LogOdds8 served = texture->cells[static_cast<std::size_t>(row * 7 + column)];
      if (column >= kLayout.RowSize(row)) {
        EXPECT_EQ(served, kUnobserved);
        continue;
      }
      int sum = 0;
      bool seen = false;
      for (const LtrContribution& contribution : all) {
        const LogOdds8 cell =
            contribution.cells[kLayout.RowStart(row) + static_cast<std::size_t>(column)];
        sum += cell == kUnobserved ? 0 : cell;
        seen = seen || cell != kUnobserved;
      }
      EXPECT_EQ(served, seen ? std::clamp(sum, -100, 100) : kUnobserved);
    }
  }
  EXPECT_EQ(layer.Texture(kLayout), texture);  // made once
}

TEST(LtrLayerTest, RemovingAContributionGivesExactlyTheStateWithoutIt) {
  RandomSequence random(3);
  for (int round = 0; round < 100; ++round) {
    LtrLayer with(kLayout.cell_count());
    LtrLayer without(kLayout.cell_count());
    const auto removed = static_cast<std::uint32_t>(random.NextBits() % 8);
    for (std::uint32_t place = 0; place < 8; ++place) {
      const LtrContribution contribution = RandomContribution(random, place);
      with.Add(contribution);
      if (place != removed) {
        without.Add(contribution);
      }
    }
    with.Texture(kLayout);
    EXPECT_TRUE(with.Remove(PlaceId{removed}));
    EXPECT_FALSE(with.Remove(PlaceId{removed}));
    EXPECT_EQ(BytesOf(with), BytesOf(without));
    EXPECT_EQ(with.Texture(kLayout)->cells, without.Texture(kLayout)->cells);
  }
}

TEST(LtrLayerTest, TheOrderOfArrivalDoesNotMatter) {
  RandomSequence random(4);
  std::vector<LtrContribution> all;
  for (std::uint32_t place = 0; place < 8; ++place) {
    all.push_back(RandomContribution(random, place));
  }
  LtrLayer forwards(kLayout.cell_count());
  LtrLayer backwards(kLayout.cell_count());
  for (std::size_t i = 0; i < all.size(); ++i) {
    forwards.Add(all[i]);
    backwards.Add(all[all.size() - 1 - i]);
  }
  EXPECT_EQ(BytesOf(forwards), BytesOf(backwards));
}

TEST(LtrLayerTest, TheNinthFoldsWhatWasObservedFirstIntoTheBase) {
  RandomSequence random(5);
  LtrLayer layer(kLayout.cell_count());
  for (std::uint32_t place = 0; place < 8; ++place) {
    LtrContribution contribution = RandomContribution(random, place);
    contribution.stamp_ns = 100 + place;
    layer.Add(contribution);
  }
  EXPECT_FALSE(layer.base().has_value());
  // An old view that arrives late goes into the base itself.
  LtrContribution late = RandomContribution(random, 8);
  late.stamp_ns = 50;
  layer.Add(late);
  ASSERT_TRUE(layer.base().has_value());
  EXPECT_EQ(layer.base()->cells, late.cells);
  EXPECT_EQ(layer.contributions().front().place, PlaceId{0});
  EXPECT_FALSE(layer.Remove(PlaceId{8}));
  LtrContribution next = RandomContribution(random, 9);
  next.stamp_ns = 500;
  layer.Add(next);
  EXPECT_EQ(layer.contributions().size(), 8U);
  EXPECT_EQ(layer.contributions().front().place, PlaceId{1});
  EXPECT_EQ(layer.base()->place, PlaceId{0});  // the later of those folded
}

TEST(LtrLayerTest, MergingFillsOnlyWhatThePlaceHadNotSeenThere) {
  RandomSequence random(6);
  LtrLayer layer(kLayout.cell_count());
  const LtrContribution first = RandomContribution(random, 3);
  LtrContribution second = RandomContribution(random, 3);
  second.stamp_ns = first.stamp_ns;
  layer.Merge(first);
  layer.Merge(second);
  ASSERT_EQ(layer.contributions().size(), 1U);
  for (std::size_t i = 0; i < kLayout.cell_count(); ++i) {
    EXPECT_EQ(layer.contributions()[0].cells[i],
              first.cells[i] == kUnobserved ? second.cells[i] : first.cells[i]);
  }
}

TEST(LtrLayerTest, IsReadBackAsWritten) {
  RandomSequence random(7);
  const LtrLayout large(300, 280);
  LtrLayer layer(large.cell_count());
  for (std::uint32_t place = 0; place < 10; ++place) {
    LtrContribution contribution = RandomContribution(random, place);
    // Long runs of either kind, and noise.
    contribution.cells.resize(large.cell_count(), place % 2 == 0 ? kUnobserved : LogOdds8{7});
    layer.Add(contribution);
  }
  const std::string bytes = BytesOf(layer);
  BinaryReader reader(bytes);
  LtrLayer read(large.cell_count());
  read.VisitFields(reader);
  ASSERT_TRUE(reader.Finish("layer").ok());
  EXPECT_EQ(BytesOf(read), bytes);
  EXPECT_EQ(read.Texture(large)->cells, layer.Texture(large)->cells);
}

TEST(LtrLayerTest, CoarseCellsAreTheMaximaOfTheFineOnes) {
  RandomSequence random(8);
  const LtrLayout layout(37, 21);
  LtrLayer layer(layout.cell_count());
  LtrContribution contribution = RandomContribution(random, 0);
  contribution.cells.resize(layout.cell_count(), LogOdds8{-9});
  layer.Add(contribution);
  const auto texture = layer.Texture(layout);
  ASSERT_EQ(texture->coarse_column_count, 5);
  ASSERT_EQ(texture->coarse_row_count, 3);
  for (std::int32_t row = 0; row < 3; ++row) {
    for (std::int32_t column = 0; column < 5; ++column) {
      LogOdds8 largest = kUnobserved;
      for (std::int32_t y = 8 * row; y < std::min(21, 8 * row + 8); ++y) {
        for (std::int32_t x = 8 * column; x < std::min(37, 8 * column + 8); ++x) {
          largest = std::max(largest, texture->cells[static_cast<std::size_t>(y * 37 + x)]);
        }
      }
      EXPECT_EQ(texture->coarse_cells[static_cast<std::size_t>(row * 5 + column)], largest);
    }
  }
}

}  // namespace
}  // namespace loci
