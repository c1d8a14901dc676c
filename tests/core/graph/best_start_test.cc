// SPDX-License-Identifier: Apache-2.0
// The starts, and the best of them.
#include "core/graph/best_start.h"

#include <gtest/gtest.h>

#include "core/graph/g2o_format.h"
#include "core/graph/prefix_start.h"
#include "core/graph/space_problem.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_space_graph.h"
#include "tests/support/datasets.h"
#include "tests/support/matchers.h"
#include "tests/support/public_graphs.h"

namespace loci {
namespace {

TEST(BestStartTest, EveryStartLeadsToTheSameMinimumOfAnEasyGraph) {
  PoseGraph graph = RandomLoopGraph(64, 150);
  AddPoints(65, 30, graph);
  AddPriors(66, graph);
  graph.fixed.clear();
  PoseGraph best = graph;
  const StatusOr<BestStartSummary> summary = OptimizeFromBestStart(best, BestStartOptions{});
  ASSERT_THAT(summary, IsOk());
  EXPECT_TRUE(summary->optimization.converged);
  EXPECT_EQ(summary->optimization.chi2_before, Chi2(graph));
  EXPECT_NEAR(summary->optimization.chi2_after, Chi2(best), 1e-12 * Chi2(best));
  for (const GraphStart start : StartsFor(graph)) {
    PoseGraph attempt = graph;
    PlaceAtStart(start, attempt);
    OptimizeSparse(attempt, SparseOptions{});
    EXPECT_NEAR(Chi2(attempt), Chi2(best), 1e-6 * Chi2(best)) << GraphStartName(start);
  }
}

TEST(BestStartTest, EveryStartLeadsToTheSameMinimumOfAnEasyGraphInSpace) {
  SpaceGraph graph = RandomSpaceGraph(67, 50);
  AddPoints(68, 10, graph);
  AddPriors(69, graph);
  SpaceGraph best = graph;
  ASSERT_THAT(OptimizeFromBestStart(best, BestStartOptions{}), IsOk());
  for (const GraphStart start : StartsFor(graph)) {
    SpaceGraph attempt = graph;
    PlaceAtStart(start, attempt);
    OptimizeSparse(attempt, SparseOptions{});
    EXPECT_NEAR(Chi2(attempt), Chi2(best), 1e-6 * Chi2(best)) << GraphStartName(start);
  }
}

TEST(BestStartTest, TwoStartsThatAgreeAreEnoughAndOneIsNot) {
  PoseGraph easy = RandomLoopGraph(70, 100);
  const StatusOr<BestStartSummary> agreed = OptimizeFromBestStart(easy, BestStartOptions{});
  ASSERT_THAT(agreed, IsOk());
  EXPECT_EQ(agreed->attempts.size(), 2U);
  // The cheaper start comes first.
  EXPECT_LT(agreed->attempts[0].cost_before, agreed->attempts[1].cost_before);
  // No pose constraint closes a loop, so that all but two starts are one and the same.
  PoseGraph by_points = RandomLoopGraph(71, 20);
  by_points.constraints.resize(19);
  AddPoints(72, 10, by_points);
  for (std::uint32_t i = 1; i < 20; ++i) {
    by_points.map_from_node[i] =
        by_points.map_from_node[i - 1] * by_points.constraints[i - 1].from_from_to;
  }
  const StatusOr<BestStartSummary> summary = OptimizeFromBestStart(by_points, BestStartOptions{});
  ASSERT_THAT(summary, IsOk());
  EXPECT_LE(summary->attempts.size(), 3U);
}

TEST(BestStartTest, TimesAreThoseOfTheClockThatItIsGiven) {
  PoseGraph graph = RandomLoopGraph(73, 40);
  BestStartOptions options;
  double now_s = 0.0;
  options.clock_s = [&] { return now_s += 1.0; };
  const StatusOr<BestStartSummary> summary = OptimizeFromBestStart(graph, options);
  ASSERT_THAT(summary, IsOk());
  // One tick for each of the five cheap starts, for each attempt, and for the finish.
  EXPECT_EQ(summary->start_s, 5.0);
  EXPECT_EQ(summary->solve_s, static_cast<double>(summary->attempts.size()) + 1.0);
}

TEST(BestStartTest, SameBitsTwice) {
  PoseGraph graph = RandomLoopGraph(74, 80);
  AddPriors(75, graph);
  PoseGraph again = graph;
  ASSERT_THAT(OptimizeFromBestStart(graph, BestStartOptions{}), IsOk());
  ASSERT_THAT(OptimizeFromBestStart(again, BestStartOptions{}), IsOk());
  EXPECT_EQ(graph.map_from_node, again.map_from_node);
}

TEST(BestStartTest, RefusesAnInvalidGraphAndLeavesIt) {
  PoseGraph graph = RandomLoopGraph(76, 30);
  graph.constraints[3].to = graph.constraints[3].from;
  const PoseGraph before = graph;
  EXPECT_THAT(OptimizeFromBestStart(graph, BestStartOptions{}),
              IsStatus(StatusCode::kInvalidArgument, "constraints[3]"));
  EXPECT_EQ(graph.map_from_node, before.map_from_node);
  SpaceGraph space = RandomSpaceGraph(77, 5);
  space.constraints[0].to = 99;
  EXPECT_THAT(OptimizeFromBestStart(space, BestStartOptions{}),
              IsStatus(StatusCode::kInvalidArgument, "constraints[0]"));
}

// A pair of nodes that a constraint joins with a half turn, and its double.
PoseGraph HalfTurns() {
  PoseGraph graph;
  graph.map_from_node.resize(3);
  graph.constraints = {{.from = 0, .to = 1, .from_from_to = {1.0, 0.0, kPi}},
                       {.from = 0, .to = 1, .from_from_to = {1.0, 0.0, kPi}},
                       {.from = 1, .to = 2, .from_from_to = {1.0, 0.0, kPi}},
                       {.from = 2, .to = 0, .from_from_to = {0.0, 0.0, 1e-3}}};
  return graph;
}

TEST(BestStartTest, PrefixesAreOfPairsOnlyAndHaveNodes) {
  PoseGraph graph = RandomLoopGraph(3, 60);
  EXPECT_DEATH(PlaceByPrefixes(0, graph), "batch_count");
  PlaceByPrefixes(1, graph);
  EXPECT_LT(Chi2(graph), Chi2(RandomLoopGraph(3, 60)));
  graph.joint_constraints.emplace_back();
  EXPECT_DEATH(PlaceByPrefixes(1, graph), "joint_constraints");
}

TEST(BestStartTest, TakesGraphsThatAreHardlyGraphs) {
  for (const GraphStart start : StartsFor(PoseGraph{})) {
    PoseGraph graph;
    PlaceAtStart(start, graph);
    graph.map_from_node.resize(1);
    PlaceAtStart(start, graph);
    graph.map_from_node.resize(3);
    graph.points_in_map.resize(1, Eigen::Vector2d::Zero());
    PlaceAtStart(start, graph);
    graph.constraints.push_back({.from = 2, .to = 1, .information = Eigen::Matrix3d::Zero()});
    graph.point_constraints.push_back({.from = 2, .information = Eigen::Matrix2d::Zero()});
    PlaceAtStart(start, graph);
    EXPECT_THAT(ValidateGraph(graph), IsOk()) << GraphStartName(start);
    PoseGraph half_turns = HalfTurns();
    PlaceAtStart(start, half_turns);
    OptimizeSparse(half_turns, SparseOptions{});
    // The given poses, all the same, are in another minimum.
    EXPECT_TRUE(Chi2(half_turns) < 1e-5 || start == GraphStart::kGiven) << GraphStartName(start);
  }
  PoseGraph empty;
  EXPECT_THAT(OptimizeFromBestStart(empty, BestStartOptions{}), IsOk());
  PoseGraph half_turns = HalfTurns();
  EXPECT_THAT(OptimizeFromBestStart(half_turns, BestStartOptions{}), IsOk());
  EXPECT_LT(Chi2(half_turns), 1e-5);
}

TEST(BestStartTest, TakesGraphsInSpaceThatAreHardlyGraphs) {
  for (const GraphStart start : StartsFor(SpaceGraph{})) {
    SpaceGraph graph;
    PlaceAtStart(start, graph);
    graph.map_from_node.resize(3);
    graph.points_in_map.resize(1, Eigen::Vector3d::Zero());
    PlaceAtStart(start, graph);
    graph.constraints.push_back({.from = 2, .to = 1});
    graph.constraints.back().information.setZero();
    graph.point_constraints.push_back({.from = 2, .information = Eigen::Matrix3d::Zero()});
    PlaceAtStart(start, graph);
    EXPECT_THAT(ValidateGraph(graph), IsOk()) << GraphStartName(start);
  }
  SpaceGraph empty;
  EXPECT_THAT(OptimizeFromBestStart(empty, BestStartOptions{}), IsOk());
}

class PublicGraphTest : public testing::TestWithParam<PublicGraph> {};

TEST_P(PublicGraphTest, ReachesTheBestKnownChi2) {
  LOCI_DATASET_OR_SKIP(text, GetParam().file);
  StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_THAT(parsed, IsOk());
  const StatusOr<BestStartSummary> summary =
      parsed->in_space() ? OptimizeFromBestStart(parsed->space, BestStartOptions{})
                         : OptimizeFromBestStart(parsed->plane, BestStartOptions{});
  ASSERT_THAT(summary, IsOk());
  EXPECT_TRUE(summary->optimization.converged);
  const double chi2 = parsed->in_space() ? Chi2(parsed->space) : Chi2(parsed->plane);
  EXPECT_LT(chi2, 1.001 * GetParam().best_chi2);
  EXPECT_GT(chi2, 0.999 * GetParam().best_chi2);
}

INSTANTIATE_TEST_SUITE_P(All, PublicGraphTest, testing::ValuesIn(kPublicGraphs), NameOfPublicGraph);

}  // namespace
}  // namespace loci
