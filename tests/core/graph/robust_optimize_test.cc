// SPDX-License-Identifier: Apache-2.0
// Maps that stay true although closures are false.
#include "core/graph/robust_optimize.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/core/graph/false_closures.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

PoseGraph Optimum(PoseGraph graph) {
  OptimizeSparse(graph, SparseOptions{});
  return graph;
}

// As `optimum` with false closures, at poses that follow from its odometry.
PoseGraph WithFalseClosures(const PoseGraph& optimum, const FalseClosureOptions& options) {
  PoseGraph graph = optimum;
  AddFalseClosures(options, graph);
  PlaceByOdometry(graph);
  return graph;
}

TEST(RobustOptimizeTest, NamesAreReadBack) {
  for (const RobustMethod method : kRobustMethods) {
    EXPECT_EQ(RobustMethodFromName(RobustMethodName(method)), method);
  }
  EXPECT_EQ(RobustMethodName(RobustMethod::kGemanMcClure), "geman-mcclure");
  EXPECT_EQ(RobustMethodFromName("Huber"), std::nullopt);
}

TEST(RobustOptimizeTest, EveryMethodButNoneRefusesOneWrongClosureOfAnEasyGraph) {
  const PoseGraph optimum = Optimum(RandomLoopGraph(71, 120));
  for (const RobustMethod method : kRobustMethods) {
    PoseGraph graph = WithFalseClosures(optimum, {72, 1, 1});
    RobustOptions options;
    options.method = method;
    const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, options);
    ASSERT_THAT(summary, IsOk());
    const RobustScore score = ScoreOf(optimum, graph, summary->accepted.constraints);
    if (method == RobustMethod::kNone) {
      EXPECT_LT(score.precision, 1.0);
      EXPECT_GT(score.rms_m, 0.5);
    } else {
      EXPECT_EQ(score.precision, 1.0) << RobustMethodName(method);
      EXPECT_GT(score.recall, 0.95) << RobustMethodName(method);
      EXPECT_LT(score.rms_m, 0.1) << RobustMethodName(method);
    }
    EXPECT_NEAR(summary->optimization.chi2_after,
                Chi2(PartOf(graph, summary->accepted)),
                1e-9 * summary->optimization.chi2_after);
  }
}

TEST(RobustOptimizeTest, ClosuresAreTheConstraintsBetweenNodesThatDoNotFollowEachOther) {
  PoseGraph graph;
  graph.map_from_node.resize(5);
  for (const auto& [from, to] : {std::pair{0U, 1U}, {2U, 1U}, {1U, 3U}, {4U, 0U}}) {
    graph.constraints.push_back({from, to});
  }
  graph.constraints[0].robust = true;
  MarkClosures(graph);
  std::vector<bool> marked;
  for (const GraphConstraint& constraint : graph.constraints) {
    marked.push_back(constraint.robust);
  }
  EXPECT_EQ(marked, (std::vector<bool>{false, false, true, true}));
}

class FalseClosuresTest : public testing::TestWithParam<std::size_t> {};

TEST_P(FalseClosuresTest, ConsistencyKeepsTheMapOfATown) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
    const PoseGraph optimum = Optimum(ManhattanWorld(seed, 1500));
    PoseGraph graph = WithFalseClosures(optimum, {seed + 100, 300, GetParam()});
    const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, RobustOptions{});
    ASSERT_THAT(summary, IsOk());
    const RobustScore score = ScoreOf(optimum, graph, summary->accepted.constraints);
    EXPECT_GE(score.precision, 0.99) << "seed " << seed;
    EXPECT_GE(score.recall, 0.95) << "seed " << seed;
    EXPECT_LE(score.rms_m, 0.1) << "seed " << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(RunLength, FalseClosuresTest, testing::Values(1, 10));

// A town with odometry and 200 false closures only.
PoseGraph WithoutATrueClosure() {
  const PoseGraph town = ManhattanWorld(5, 1000);
  PoseGraph with_false = town;
  AddFalseClosures({105, 200, 1}, with_false);
  PoseGraph graph = PartOf(town, TrustedOf(town));
  graph.constraints.insert(
      graph.constraints.end(), with_false.constraints.end() - 200, with_false.constraints.end());
  return graph;
}

TEST(RobustOptimizeTest, WithoutATrueClosureNoFalseOneBendsTheMap) {
  PoseGraph graph = WithoutATrueClosure();
  const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, RobustOptions{});
  ASSERT_THAT(summary, IsOk());
  const std::vector<bool>& accepted = summary->accepted.constraints;
  EXPECT_LE(std::count(accepted.begin() + 999, accepted.end(), true), 2);
}

TEST(RobustOptimizeTest, ANodeFarOutMakesNoFalseClosureMoreCertain) {
  PoseGraph graph = WithoutATrueClosure();
  graph.map_from_node.emplace_back();
  graph.constraints.push_back({0, 1000, Pose2{1e6, 1e6, 0.0}, Eigen::Matrix3d::Identity(), false});
  const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, RobustOptions{});
  ASSERT_THAT(summary, IsOk());
  const std::vector<bool>& accepted = summary->accepted.constraints;
  EXPECT_LE(std::count(accepted.begin() + 999, accepted.end() - 1, true), 2);
}

TEST(RobustOptimizeTest, AClosureBeyondTheRangeOfNumbersIsRefusedByEveryMethodButNone) {
  for (const RobustMethod method : kRobustMethods) {
    for (const double far_m : {1e100, 1e200}) {
      PoseGraph graph = Optimum(RandomLoopGraph(76, 60));
      graph.constraints.push_back(
          {10, 40, Pose2{far_m, -far_m, 1.0}, Eigen::Matrix3d::Identity(), true});
      RobustOptions options;
      options.method = method;
      const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, options);
      ASSERT_THAT(summary, IsOk());
      if (method != RobustMethod::kNone) {
        EXPECT_FALSE(summary->accepted.constraints.back()) << RobustMethodName(method);
      }
    }
  }
}

TEST(RobustOptimizeTest, SameBitsTwiceAndInAnyOrderOfTheConstraints) {
  const PoseGraph optimum = Optimum(ManhattanWorld(6, 600));
  PoseGraph graph = WithFalseClosures(optimum, {106, 100, 1});
  SortConstraints(graph);
  PoseGraph again = graph;
  PoseGraph reversed = graph;
  std::reverse(reversed.constraints.begin(), reversed.constraints.end());
  SortConstraints(reversed);
  for (PoseGraph* each : {&graph, &again, &reversed}) {
    ASSERT_THAT(OptimizeRobustly(*each, RobustOptions{}), IsOk());
  }
  EXPECT_EQ(graph.map_from_node, again.map_from_node);
  EXPECT_EQ(graph.map_from_node, reversed.map_from_node);
}

// Two sessions in one town, each in a frame of its own, joined by closures only.
struct TwoSessions {
  PoseGraph graph;
  std::vector<Pose2> truth;
};
TwoSessions MakeTwoSessions(std::uint64_t seed) {
  TwoSessions result;
  result.graph = ManhattanWorld(seed, 1200);
  result.truth = Optimum(result.graph).map_from_node;
  std::erase_if(result.graph.constraints, [](const GraphConstraint& constraint) {
    return !constraint.robust && constraint.to == 600;
  });
  PlaceByOdometry(result.graph);
  for (std::size_t i = 600; i < 1200; ++i) {
    result.graph.map_from_node[i] = Pose2{500.0, -300.0, 2.0} * result.graph.map_from_node[i];
  }
  return result;
}

TEST(RobustOptimizeTest, SessionsAreJoinedByTheClosuresThatAgree) {
  TwoSessions sessions = MakeTwoSessions(7);
  PoseGraph optimum = sessions.graph;
  optimum.map_from_node = sessions.truth;
  OptimizeSparse(optimum, SparseOptions{});
  PoseGraph graph = optimum;
  AddFalseClosures({107, 200, 1}, graph);
  graph.map_from_node = sessions.graph.map_from_node;
  const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, RobustOptions{});
  ASSERT_THAT(summary, IsOk());
  const RobustScore score = ScoreOf(optimum, graph, summary->accepted.constraints);
  EXPECT_GE(score.precision, 0.99);
  EXPECT_GE(score.recall, 0.95);
  EXPECT_LE(score.rms_m, 0.1);
}

TEST(RobustOptimizeTest, OneClosureAloneJoinsNoSessions) {
  for (const bool poses_fit : {false, true}) {
    PoseGraph graph = MakeTwoSessions(8).graph;
    std::erase_if(graph.constraints, [](const GraphConstraint& constraint) {
      return constraint.from < 600 && constraint.to >= 600;
    });
    const Pose2 fitting = Inverse(graph.map_from_node[0]) * graph.map_from_node[600];
    graph.constraints.push_back(
        {0, 600, poses_fit ? fitting : Pose2{1.0, 2.0, 0.5}, Eigen::Matrix3d::Identity(), true});
    const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, RobustOptions{});
    ASSERT_THAT(summary, IsOk());
    EXPECT_FALSE(summary->accepted.constraints.back()) << poses_fit;
  }
}

TEST(RobustOptimizeTest, FixedNodesAreOneSession) {
  PoseGraph graph;
  graph.map_from_node = {Pose2{}, Pose2{1.0, 0.0, 0.0}, Pose2{1.0, 1.0, 0.0}};
  graph.fixed = {true, true, false};
  const Eigen::Matrix3d information = 100.0 * Eigen::Matrix3d::Identity();
  graph.constraints = {{1, 2, Pose2{0.0, 1.0, 0.0}, information, false},
                       {0, 2, Pose2{1.0, 1.0, 0.0}, information, true},
                       {0, 2, Pose2{1.0, 3.0, 0.0}, information, true}};
  const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, RobustOptions{});
  ASSERT_THAT(summary, IsOk());
  EXPECT_EQ(summary->accepted.constraints, (std::vector<bool>{true, true, false}));
}

TEST(RobustOptimizeTest, WrongPriorsAndPointsAreRefusedToo) {
  PoseGraph optimum = Optimum(RandomLoopGraph(73, 80));
  AddPoints(74, 10, optimum);  // sees its nodes where they are now
  for (PointConstraint& constraint : optimum.point_constraints) {
    constraint.robust = true;
  }
  OptimizeSparse(optimum, SparseOptions{});
  PosePrior prior;
  prior.node = 30;
  prior.map_from_node = optimum.map_from_node[30];
  prior.robust = true;
  PositionPrior position;
  position.node = 50;
  position.node_in_map = optimum.map_from_node[50].translation();
  position.robust = true;
  optimum.pose_priors = {prior, prior};
  optimum.position_priors = {position, position};
  for (const RobustMethod method : {RobustMethod::kGemanMcClure, RobustMethod::kConsistent}) {
    PoseGraph graph = optimum;
    graph.pose_priors[1].map_from_node.x += 20.0;
    graph.position_priors[1].node_in_map.y() -= 20.0;
    graph.point_constraints.back().point_in_from.x() += 20.0;
    PlaceByOdometry(graph);
    RobustOptions options;
    options.method = method;
    const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, options);
    ASSERT_THAT(summary, IsOk());
    EXPECT_EQ(summary->accepted.pose_priors, (std::vector<bool>{true, false}));
    EXPECT_EQ(summary->accepted.position_priors, (std::vector<bool>{true, false}));
    EXPECT_FALSE(summary->accepted.point_constraints.back());
    const auto refused = std::count(summary->accepted.point_constraints.begin(),
                                    summary->accepted.point_constraints.end(),
                                    false);
    EXPECT_LE(refused, 3);
    EXPECT_LT(ScoreOf(optimum, graph, summary->accepted.constraints).rms_m, 0.1)
        << RobustMethodName(method);
  }
}

TEST(RobustOptimizeTest, RefusesAnInvalidGraphAndTakesGraphsThatAreHardlyGraphs) {
  for (const RobustMethod method : kRobustMethods) {
    RobustOptions options;
    options.method = method;
    PoseGraph invalid = RandomLoopGraph(75, 30);
    invalid.constraints[3].to = 99;
    const PoseGraph before = invalid;
    EXPECT_THAT(OptimizeRobustly(invalid, options),
                IsStatus(StatusCode::kInvalidArgument, "constraints[3]"));
    EXPECT_EQ(invalid.map_from_node, before.map_from_node);
    PoseGraph graph;
    EXPECT_THAT(OptimizeRobustly(graph, options), IsOk());
    graph.map_from_node.resize(3);
    EXPECT_THAT(OptimizeRobustly(graph, options), IsOk());
    graph.constraints.push_back({0, 1, Pose2{1.0, 0.0, 0.0}, Eigen::Matrix3d::Zero(), true});
    graph.constraints.push_back({2, 1, Pose2{1.0, 0.0, 0.0}, Eigen::Matrix3d::Identity(), true});
    EXPECT_THAT(OptimizeRobustly(graph, options), IsOk());
  }
}

}  // namespace
}  // namespace loci
