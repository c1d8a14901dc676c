// SPDX-License-Identifier: Apache-2.0
// Spanning trees by weight.
#include "core/graph/spanning_tree.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/core/graph/random_graph.h"

namespace loci {
namespace {

PoseGraph RandomTopology(std::uint64_t seed, std::uint32_t nodes, std::size_t constraints) {
  RandomSequence random(seed);
  PoseGraph graph;
  graph.map_from_node.resize(nodes);
  while (graph.constraints.size() < constraints) {
    const auto from = static_cast<std::uint32_t>(random.NextBits() % nodes);
    const auto to = static_cast<std::uint32_t>(random.NextBits() % nodes);
    if (from != to) {
      graph.constraints.push_back({.from = from, .to = to});
    }
  }
  return graph;
}

std::vector<double> RandomCosts(std::uint64_t seed, std::size_t count) {
  RandomSequence random(seed);
  std::vector<double> costs;
  for (std::size_t i = 0; i < count; ++i) {
    costs.push_back(random.NextUniform(0.1, 10.0));
  }
  return costs;
}

void ExpectForest(const PoseGraph& graph, const ToroTree& tree) {
  const GraphComponents components = FindComponents(graph);
  ASSERT_EQ(tree.order.size(), graph.map_from_node.size());
  std::vector<bool> seen(tree.order.size());
  std::uint32_t roots = 0;
  for (const std::uint32_t node : tree.order) {
    EXPECT_FALSE(seen[node]);
    seen[node] = true;
    if (tree.parent[node] == ToroTree::kNone) {
      ++roots;
      EXPECT_EQ(tree.depth[node], 0U);
      continue;
    }
    EXPECT_TRUE(seen[tree.parent[node]]);
    EXPECT_EQ(tree.depth[node], tree.depth[tree.parent[node]] + 1);
    const GraphConstraint& constraint = graph.constraints[tree.parent_constraint[node]];
    EXPECT_EQ(std::minmax(constraint.from, constraint.to),
              std::minmax(node, std::uint32_t{tree.parent[node]}));
  }
  EXPECT_EQ(roots, components.count);
}

TEST(SpanningTreeTest, PathsAreTheShortest) {
  for (const std::uint64_t seed : {501U, 502U, 503U}) {
    const PoseGraph graph = RandomTopology(seed, 40, 70);
    const std::vector<double> costs = RandomCosts(seed + 10, graph.constraints.size());
    const ToroTree tree = ShortestPathTree(graph, costs);
    ExpectForest(graph, tree);
    // Bellman and Ford's, plainly.
    std::vector<double> shortest(40, std::numeric_limits<double>::infinity());
    const std::vector<bool> held = HeldNodes(graph);
    for (std::size_t i = 0; i < 40; ++i) {
      shortest[i] = held[i] ? 0.0 : shortest[i];
    }
    for (int round = 0; round < 40; ++round) {
      for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
        double& from = shortest[graph.constraints[i].from];
        double& to = shortest[graph.constraints[i].to];
        from = std::min(from, to + costs[i]);
        to = std::min(to, from + costs[i]);
      }
    }
    for (std::uint32_t node = 0; node < 40; ++node) {
      double sum = 0.0;
      for (std::uint32_t n = node; tree.parent[n] != ToroTree::kNone; n = tree.parent[n]) {
        sum += costs[tree.parent_constraint[n]];
      }
      EXPECT_NEAR(sum, shortest[node], 1e-12);
    }
  }
}

TEST(SpanningTreeTest, SumIsTheLeast) {
  for (const std::uint64_t seed : {511U, 512U, 513U}) {
    const PoseGraph graph = RandomTopology(seed, 40, 70);
    const std::vector<double> costs = RandomCosts(seed + 10, graph.constraints.size());
    const ToroTree tree = MinimumSpanningTree(graph, costs);
    ExpectForest(graph, tree);
    double sum = 0.0;
    for (const std::uint32_t i : tree.parent_constraint) {
      sum += i == ToroTree::kNone ? 0.0 : costs[i];
    }
    // Kruskal's, plainly: cheapest first, unless it joins what is joined.
    std::vector<std::size_t> order(costs.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](auto a, auto b) { return costs[a] < costs[b]; });
    std::vector<std::uint32_t> label(40);
    std::iota(label.begin(), label.end(), 0U);
    double least = 0.0;
    for (const std::size_t i : order) {
      const std::uint32_t from = label[graph.constraints[i].from];
      const std::uint32_t to = label[graph.constraints[i].to];
      least += from == to ? 0.0 : costs[i];
      std::replace(label.begin(), label.end(), from, to);
    }
    EXPECT_NEAR(sum, least, 1e-12);
  }
}

TEST(SpanningTreeTest, StepsGiveTheOdometry) {
  const PoseGraph graph = RandomLoopGraph(521, 60);
  const ToroTree tree = MinimumSpanningTree(graph, StepCosts(graph));
  for (std::uint32_t node = 1; node < 60; ++node) {
    EXPECT_EQ(tree.parent[node], node - 1);
  }
}

TEST(SpanningTreeTest, ThePathGoesWhereLessIsUncertain) {
  PoseGraph graph;
  graph.map_from_node.resize(3);
  graph.constraints = {{.from = 0, .to = 1}, {.from = 1, .to = 2}, {.from = 0, .to = 2}};
  for (GraphConstraint& constraint : graph.constraints) {
    constraint.from_from_to.x = 1.0;
    constraint.information = 100.0 * Eigen::Matrix3d::Identity();
  }
  EXPECT_EQ(ShortestPathTree(graph, UncertaintyCosts(graph)).parent[2], 0U);
  graph.constraints[2].information(2, 2) = 10.0;
  EXPECT_EQ(ShortestPathTree(graph, UncertaintyCosts(graph)).parent[2], 1U);
}

}  // namespace
}  // namespace loci
