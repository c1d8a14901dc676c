// SPDX-License-Identifier: Apache-2.0
// Sets of what agrees, against all subsets tried one by one.
#include "core/graph/consistent_set.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

// Random weights; each pair is a conflict with `conflict_part`, else a link if `linked`.
ConsistencyGraph RandomGraph(std::uint64_t seed,
                             std::uint32_t count,
                             double conflict_part,
                             bool linked) {
  RandomSequence random(seed);
  ConsistencyGraph graph;
  for (std::uint32_t i = 0; i < count; ++i) {
    graph.weights.push_back(random.NextUniform(1.0, 3.0));
    for (std::uint32_t j = 0; j < i; ++j) {
      if (random.NextUnit() < conflict_part) {
        graph.conflicts.emplace_back(i, j);
      } else if (linked) {
        graph.links.emplace_back(j, i);
      }
    }
  }
  return graph;
}

double WeightOf(const ConsistencyGraph& graph, const std::vector<std::uint32_t>& set) {
  double weight = 0.0;
  for (const std::uint32_t item : set) {
    weight += graph.weights[item];
  }
  return weight;
}

double HeaviestByTryingAll(const ConsistencyGraph& graph) {
  double best = 0.0;
  for (std::uint32_t subset = 0; subset < 1U << graph.weights.size(); ++subset) {
    const auto inside = [&](std::uint32_t item) { return (subset >> item & 1U) != 0; };
    if (std::none_of(graph.conflicts.begin(), graph.conflicts.end(), [&](const auto& pair) {
          return inside(pair.first) && inside(pair.second);
        })) {
      double weight = 0.0;
      for (std::uint32_t i = 0; i < graph.weights.size(); ++i) {
        weight += inside(i) ? graph.weights[i] : 0.0;
      }
      best = std::max(best, weight);
    }
  }
  return best;
}

void ExpectConflictFreeCover(const ConsistencyGraph& graph,
                             const std::vector<std::vector<std::uint32_t>>& sets) {
  std::set<std::uint32_t> seen;
  std::size_t count = 0;
  for (const std::vector<std::uint32_t>& set : sets) {
    const std::set<std::uint32_t> members(set.begin(), set.end());
    seen.insert(set.begin(), set.end());
    count += set.size();
    for (const auto& [a, b] : graph.conflicts) {
      EXPECT_FALSE(members.contains(a) && members.contains(b)) << a << " and " << b;
    }
  }
  EXPECT_EQ(seen.size(), graph.weights.size());
  EXPECT_EQ(count, graph.weights.size());
}

TEST(ConsistentSetTest, TheFirstSetIsTheHeaviestOfAllSubsetsWithoutAConflict) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    // A hub that is linked to all and in conflict with none keeps every subset together.
    ConsistencyGraph graph = RandomGraph(seed, 13, 0.1 + 0.02 * static_cast<double>(seed), true);
    graph.weights.push_back(1.0);
    for (std::uint32_t i = 0; i < 13; ++i) {
      graph.links.emplace_back(i, 13);
    }
    const auto sets = ConsistentSets(graph);
    ExpectConflictFreeCover(graph, sets);
    EXPECT_NEAR(WeightOf(graph, sets.front()), HeaviestByTryingAll(graph), 1e-9) << seed;
  }
}

TEST(ConsistentSetTest, LargeComponentsAreCoveredWithoutAConflictAndTheLargestSetIsFound) {
  // 150 that agree, and 100 others that contradict each other and some of them.
  ConsistencyGraph graph;
  graph.weights.assign(250, 1.0);
  RandomSequence random(7);
  for (std::uint32_t i = 0; i < 250; ++i) {
    for (std::uint32_t j = 0; j < i; ++j) {
      if (i < 150 || random.NextUnit() < 0.5) {
        graph.links.emplace_back(i, j);
      } else {
        graph.conflicts.emplace_back(i, j);
      }
    }
  }
  const auto sets = ConsistentSets(graph);
  ExpectConflictFreeCover(graph, sets);
  std::vector<std::uint32_t> first = sets.front();
  std::sort(first.begin(), first.end());
  ASSERT_GE(first.size(), 150U);
  for (std::uint32_t i = 0; i < 150; ++i) {
    EXPECT_EQ(first[i], i);
  }
}

TEST(ConsistentSetTest, LargeComponentsTakeAgainAndAgainWhatTheLeastWeightSpeaksAgainst) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    ConsistencyGraph graph = RandomGraph(seed, 80, 0.05 * static_cast<double>(seed), true);
    for (std::uint32_t i = 0; i < 80; ++i) {
      graph.weights[i] = i % 3 == 0 ? 2.0 : 1.0;  // sums are exact
      graph.links.emplace_back(i, 80);
    }
    graph.weights.push_back(1.0);
    std::vector<std::set<std::uint32_t>> conflicts(81);
    for (const auto& [a, b] : graph.conflicts) {
      conflicts[a].insert(b);
      conflicts[b].insert(a);
    }
    std::set<std::uint32_t> open;
    for (std::uint32_t i = 0; i <= 80; ++i) {
      open.insert(i);
    }
    std::vector<std::uint32_t> expected;
    while (!open.empty()) {
      const auto cost = [&](std::uint32_t item) {
        double sum = 0.0;
        for (const std::uint32_t other : conflicts[item]) {
          sum += open.contains(other) ? graph.weights[other] : 0.0;
        }
        return sum / graph.weights[item];
      };
      const std::uint32_t best = *std::min_element(
          open.begin(), open.end(), [&](auto x, auto y) { return cost(x) < cost(y); });
      expected.push_back(best);
      open.erase(best);
      for (const std::uint32_t other : conflicts[best]) {
        open.erase(other);
      }
    }
    const auto sets = ConsistentSets(graph);
    ExpectConflictFreeCover(graph, sets);
    EXPECT_EQ(std::set<std::uint32_t>(sets.front().begin(), sets.front().end()),
              std::set<std::uint32_t>(expected.begin(), expected.end()))
        << seed;
  }
}

TEST(ConsistentSetTest, ManyEqualChoicesAreDecidedGreedily) {
  // Eight rings of five conflicts each: every branch leads to the same weight.
  ConsistencyGraph graph;
  graph.weights.assign(41, 1.0);
  for (std::uint32_t i = 0; i < 40; ++i) {
    graph.links.emplace_back(i, 40);
    graph.conflicts.emplace_back(i, i / 5 * 5 + (i + 1) % 5);
  }
  const auto sets = ConsistentSets(graph);
  ExpectConflictFreeCover(graph, sets);
  EXPECT_EQ(sets.front().size(), 17U);
}

TEST(ConsistentSetTest, WithoutALinkNothingIsASetAndWithoutAConflictEveryComponentIs) {
  ConsistencyGraph graph;
  graph.weights.assign(5, 1.0);
  EXPECT_EQ(ConsistentSets(graph).size(), 5U);
  graph.links = {{0, 2}, {2, 4}, {4, 2}, {1, 3}};
  const auto sets = ConsistentSets(graph);
  ASSERT_EQ(sets.size(), 2U);
  EXPECT_EQ(sets[0], (std::vector<std::uint32_t>{2, 0, 4}));  // the one with two links first
  EXPECT_EQ(sets[1], (std::vector<std::uint32_t>{1, 3}));
  EXPECT_TRUE(ConsistentSets({}).empty());
}

TEST(ConsistentSetTest, ASetThatFallsApartWithoutItsMiddleIsTwo) {
  ConsistencyGraph graph;
  graph.weights = {2.0, 1.0, 2.0};
  graph.links = {{0, 1}, {1, 2}};
  graph.conflicts = {{0, 1}};
  const auto sets = ConsistentSets(graph);
  EXPECT_EQ(sets, (std::vector<std::vector<std::uint32_t>>{{0}, {2}, {1}}));
}

}  // namespace
}  // namespace loci
