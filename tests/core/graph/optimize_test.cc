// SPDX-License-Identifier: Apache-2.0
// Optimisation from start to finish.
#include "core/graph/optimize.h"

#include <gtest/gtest.h>

#include "tests/core/graph/random_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

TEST(OptimizeTest, ClosesALoopFromOdometry) {
  PoseGraph graph = RandomLoopGraph(61, 200);
  const StatusOr<OptimizationSummary> summary = OptimizeGraph(graph, OptimizeOptions{});
  ASSERT_THAT(summary, IsOk());
  EXPECT_TRUE(summary->converged);
  // 199 + 180 constraints with three numbers each, for 199 free nodes: chi2 is near 3 * 180.
  EXPECT_NEAR(summary->chi2_after, 540.0, 150.0);
  EXPECT_GT(summary->chi2_before, 10.0 * summary->chi2_after);
  EXPECT_NEAR(summary->chi2_after, Chi2(graph), 1e-12 * Chi2(graph));
}

TEST(OptimizeTest, SameBitsTwiceAndNothingIsLostByDoingItAgain) {
  PoseGraph graph = RandomLoopGraph(62, 100);
  PoseGraph again = graph;
  ASSERT_THAT(OptimizeGraph(graph, OptimizeOptions{}), IsOk());
  ASSERT_THAT(OptimizeGraph(again, OptimizeOptions{}), IsOk());
  EXPECT_EQ(graph.map_from_node, again.map_from_node);
  const double chi2 = Chi2(graph);
  ASSERT_THAT(OptimizeGraph(again, OptimizeOptions{}), IsOk());
  EXPECT_NEAR(Chi2(again), chi2, 1e-9 * chi2);
}

TEST(OptimizeTest, RefusesAnInvalidGraphAndLeavesIt) {
  PoseGraph graph = RandomLoopGraph(63, 30);
  graph.constraints[3].to = graph.constraints[3].from;
  const PoseGraph before = graph;
  EXPECT_THAT(OptimizeGraph(graph, OptimizeOptions{}),
              IsStatus(StatusCode::kInvalidArgument, "constraints[3]"));
  EXPECT_EQ(graph.map_from_node, before.map_from_node);
}

TEST(OptimizeTest, TakesGraphsThatAreHardlyGraphs) {
  PoseGraph graph;
  EXPECT_THAT(OptimizeGraph(graph, OptimizeOptions{}), IsOk());
  graph.map_from_node.resize(3);
  graph.points_in_map.resize(1, Eigen::Vector2d::Zero());
  EXPECT_THAT(OptimizeGraph(graph, OptimizeOptions{}), IsOk());
}

TEST(OptimizeTest, ComponentsAreOptimisedEachForItself) {
  PoseGraph one = RandomLoopGraph(66, 60);
  const PoseGraph other = RandomLoopGraph(67, 60);
  PoseGraph both = one;
  for (const Pose2& pose : other.map_from_node) {
    both.map_from_node.push_back(pose);
  }
  for (GraphConstraint constraint : other.constraints) {
    constraint.from += 60;
    constraint.to += 60;
    both.constraints.push_back(constraint);
  }
  PoseGraph alone = other;
  ASSERT_THAT(OptimizeGraph(one, OptimizeOptions{}), IsOk());
  ASSERT_THAT(OptimizeGraph(alone, OptimizeOptions{}), IsOk());
  ASSERT_THAT(OptimizeGraph(both, OptimizeOptions{}), IsOk());
  EXPECT_NEAR(Chi2(both), Chi2(one) + Chi2(alone), 1e-6 * Chi2(both));
}

}  // namespace
}  // namespace loci
