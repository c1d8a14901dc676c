// SPDX-License-Identifier: Apache-2.0
#include "core/place/patch.h"

#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/grid/occupancy_grid.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

Patch RandomPatch(RandomSequence& random, int points, double reach_m) {
  Patch patch;
  for (int i = 0; i < points; ++i) {
    patch.Add({random.NextUniform(-reach_m, reach_m), random.NextUniform(-reach_m, reach_m)},
              i % 3 == 0 ? PatchContent::kReference : PatchContent::kOwn);
  }
  return patch;
}

std::string BytesOf(const Patch& patch) {
  BinaryWriter writer;
  writer(patch);
  return writer.TakeBytes();
}

Status Read(std::string_view bytes, Patch& patch) {
  BinaryReader reader(bytes);
  reader(patch);
  return reader.Finish("patch");
}

TEST(PatchTest, ACellHoldsTheMeanOfItsPoints) {
  Patch patch;
  EXPECT_TRUE(patch.Add({0.01, 0.02}, PatchContent::kOwn));
  EXPECT_FALSE(patch.Add({0.03, 0.04}, PatchContent::kReference));
  EXPECT_TRUE(patch.Add({-0.01, 0.02}, PatchContent::kOwn));
  ASSERT_EQ(patch.cells().size(), 2U);
  EXPECT_LT((patch.cells()[0].Mean() - Eigen::Vector2d(0.02, 0.03)).norm(), 1e-12);
  EXPECT_EQ(patch.cells()[0].hits, 2U);
  EXPECT_EQ(patch.cells()[0].own_hits, 1U);
}

TEST(PatchTest, MeansAreThoseWithEnoughHitsInOrderOfFirstObservation) {
  Patch patch;
  patch.Add({5.01, 0.01}, PatchContent::kOwn);
  patch.Add({1.01, 0.01}, PatchContent::kOwn);
  patch.Add({5.02, 0.01}, PatchContent::kOwn);
  patch.Add({-3.01, 0.01}, PatchContent::kOwn);
  ASSERT_EQ(patch.Means(1).size(), 3U);
  EXPECT_NEAR(patch.Means(1)[1].x(), 1.01, 1e-12);
  ASSERT_EQ(patch.Means(2).size(), 1U);
  EXPECT_NEAR(patch.Means(2)[0].x(), 5.015, 1e-12);
}

TEST(PatchTest, EveryCellIsFoundAndNothingElse) {
  RandomSequence random(1);
  const Patch patch = RandomPatch(random, 3000, 12.0);
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> positions;
  for (std::size_t i = 0; i < patch.cells().size(); ++i) {
    const CellIndex cell = patch.cells()[i].cell;
    EXPECT_TRUE(positions.emplace(std::pair(cell.x, cell.y), static_cast<std::int32_t>(i)).second);
    EXPECT_EQ(CellOf(patch.cells()[i].Mean(), patch.cell_size_m()), cell);
  }
  for (std::int32_t y = -260; y < 260; ++y) {
    for (std::int32_t x = -260; x < 260; ++x) {
      const auto found = positions.find({x, y});
      ASSERT_EQ(patch.Find({x, y}), found == positions.end() ? -1 : found->second);
    }
  }
  EXPECT_EQ(patch.Find({1 << 30, -(1 << 30)}), -1);
}

TEST(PatchTest, WhatWasWrittenIsReadAndFoundAndGoesOn) {
  RandomSequence random(2);
  Patch patch = RandomPatch(random, 500, 8.0);
  Patch read(0.1);
  read.Add({100.0, 100.0}, PatchContent::kOwn);
  ASSERT_THAT(Read(BytesOf(patch), read), IsOk());
  EXPECT_EQ(read.cell_size_m(), 0.05);
  for (const PatchCell& cell : patch.cells()) {
    EXPECT_EQ(read.Find(cell.cell), patch.Find(cell.cell));
  }
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2d point(random.NextUniform(-12.0, 12.0), random.NextUniform(-12.0, 12.0));
    EXPECT_EQ(patch.Add(point, PatchContent::kOwn), read.Add(point, PatchContent::kOwn));
  }
  EXPECT_EQ(BytesOf(read), BytesOf(patch));
}

TEST(PatchTest, DamagedBytesAreDataLossOrAnotherPatchNeverACrash) {
  RandomSequence random(3);
  const std::string bytes = BytesOf(RandomPatch(random, 20, 1.0));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    Patch patch;
    EXPECT_THAT(Read(std::string_view(bytes).substr(0, size), patch),
                IsStatus(StatusCode::kDataLoss));
  }
  for (int round = 0; round < 2000; ++round) {
    std::string damaged = bytes;
    damaged[random.NextBits() % damaged.size()] ^=
        static_cast<char>(1U << (random.NextBits() % 8U));
    Patch patch;
    const Status status = Read(damaged, patch);
    EXPECT_TRUE(status.ok() || status.code() == StatusCode::kDataLoss);
  }
}

}  // namespace
}  // namespace loci
