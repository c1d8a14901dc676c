// SPDX-License-Identifier: Apache-2.0
#include "core/graph/ring_order.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

constexpr std::uint32_t kSide = 12;

// Crossings of a square grid, row by row, each joined with its neighbours; some of them by cliques.
VariableGraph Grid() {
  VariableGraph grid;
  grid.count = kSide * kSide;
  for (std::uint32_t y = 0; y < kSide; ++y) {
    for (std::uint32_t x = 0; x < kSide; ++x) {
      const std::uint32_t at = y * kSide + x;
      if (x + 1 < kSide && y + 1 < kSide && at % 5 == 0) {
        grid.cliques.push_back({at, at + 1, at + kSide});
        continue;
      }
      if (x + 1 < kSide) {
        grid.edges.emplace_back(at, at + 1);
      }
      if (y + 1 < kSide) {
        grid.edges.emplace_back(at, at + kSide);
      }
    }
  }
  return grid;
}

std::size_t EntriesOf(const VariableGraph& graph, const std::vector<std::uint32_t>& order) {
  std::size_t entries = 0;
  for (const SymbolicFront& front : AnalyseElimination(graph, order).fronts) {
    entries += std::size_t{front.columns} * (front.columns + front.rows);
  }
  return entries;
}

TEST(RingOrderTest, HasEveryVariableOnceAndOuterRingsFirst) {
  RandomSequence random(5);
  const VariableGraph grid = Grid();
  std::vector<std::uint32_t> ring(grid.count);
  for (std::uint32_t& each : ring) {
    each =
        static_cast<std::uint32_t>(random.NextBits() >> 62U) * 2;  // those between have no members
  }
  std::vector<std::uint32_t> order = OrderByRings(grid, ring);
  EXPECT_TRUE(std::is_sorted(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return ring[a] > ring[b];
  }));
  std::sort(order.begin(), order.end());
  std::vector<std::uint32_t> all(grid.count);
  std::iota(all.begin(), all.end(), 0U);
  EXPECT_EQ(order, all);
}

TEST(RingOrderTest, OneRingIsTheOrderOfLittleFill) {
  const VariableGraph grid = Grid();
  EXPECT_EQ(OrderByRings(grid, std::vector<std::uint32_t>(grid.count, 0)),
            EliminationOrder(grid, {}));
}

TEST(RingOrderTest, InnerRingsKnowWhatOuterOnesJoin) {
  const VariableGraph grid = Grid();
  std::vector<std::uint32_t> ring(grid.count);
  std::vector<std::uint32_t> sorted(grid.count);
  std::iota(sorted.begin(), sorted.end(), 0U);
  for (std::uint32_t variable = 0; variable < grid.count; ++variable) {
    const std::uint32_t distance = variable % kSide + variable / kSide;
    ring[variable] = distance < 2 ? 0 : distance < 8 ? 1 : 2;
  }
  std::stable_sort(sorted.begin(), sorted.end(), [&](std::uint32_t a, std::uint32_t b) {
    return ring[a] > ring[b];
  });
  EXPECT_LT(EntriesOf(grid, OrderByRings(grid, ring)), EntriesOf(grid, sorted) * 2 / 3);
}

}  // namespace
}  // namespace loci
