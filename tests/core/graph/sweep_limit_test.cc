// SPDX-License-Identifier: Apache-2.0
#include "core/graph/sweep_limit.h"

#include <cstdint>

#include <gtest/gtest.h>

#include "core/graph/optimize.h"
#include "tests/core/graph/random_graph.h"

namespace loci {
namespace {

TEST(SweepLimitTest, GraphsAsTheyAreRecordedAreSweepable) {
  EXPECT_TRUE(IsSweepable(PoseGraph()));
  EXPECT_TRUE(IsSweepable(RandomLoopGraph(1, 2000)));
}

TEST(SweepLimitTest, AComponentOfItsOwnHasNoPathToOthers) {
  PoseGraph graph = RandomLoopGraph(1, 50);
  graph.map_from_node.resize(60);
  graph.constraints.push_back({55, 57, Pose2{1.0, 0.0, 0.0}, Eigen::Matrix3d::Identity(), false});
  EXPECT_TRUE(IsSweepable(graph));
}

// A ring whose far side is tied again and again: each tie has a path through all of it.
TEST(SweepLimitTest, ManyLongPathsAreNotSweptAndTheExactOptimiserTakesThem) {
  constexpr std::uint32_t kNodes = 20000;
  PoseGraph graph;
  graph.map_from_node.resize(kNodes);
  const auto tie = [&](std::uint32_t from, std::uint32_t to) {
    graph.constraints.push_back({from, to, Pose2{}, Eigen::Matrix3d::Identity(), false});
  };
  for (std::uint32_t i = 1; i < kNodes; ++i) {
    tie(i - 1, i);
  }
  tie(0, kNodes - 1);
  for (int i = 0; i < 10000; ++i) {
    tie(kNodes / 2, kNodes / 2 + 1);
  }
  EXPECT_FALSE(IsSweepable(graph));
  const StatusOr<OptimizationSummary> summary = OptimizeGraph(graph, {});
  ASSERT_TRUE(summary.ok());
  EXPECT_TRUE(summary->converged);
}

}  // namespace
}  // namespace loci
