// SPDX-License-Identifier: Apache-2.0
// Pose graphs in space.
#include "core/graph/space_graph.h"

#include <gtest/gtest.h>

#include "core/graph/g2o_format.h"
#include "core/graph/space_problem.h"
#include "tests/core/graph/random_space_graph.h"
#include "tests/support/datasets.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

TEST(SpaceGraphTest, JacobiansAreTheNumericOnes) {
  constexpr double kStep = 1e-6;
  RandomSequence random(51);
  for (int trial = 0; trial < 100; ++trial) {
    SpaceGraph graph;
    graph.map_from_node = {RandomPose3(random, 5.0, 3.0), RandomPose3(random, 5.0, 3.0)};
    SpaceConstraint constraint;
    constraint.to = 1;
    constraint.from_from_to =
        Inverse(graph.map_from_node[0]) * graph.map_from_node[1] * RandomPose3(random, 1.0, 0.7);
    const LinearisedPair<6, 6, 6> linearised = Linearised(graph, constraint);
    for (int axis = 0; axis < 6; ++axis) {
      for (const std::size_t node : {0U, 1U}) {
        SpaceGraph plus = graph;
        SpaceGraph minus = graph;
        plus.map_from_node[node] = Perturbed(graph.map_from_node[node], axis, kStep);
        minus.map_from_node[node] = Perturbed(graph.map_from_node[node], axis, -kStep);
        const Eigen::Matrix<double, 6, 1> numeric =
            (ErrorOf(plus, constraint) - ErrorOf(minus, constraint)) / (2.0 * kStep);
        const Eigen::Matrix<double, 6, 1> analytic =
            node == 0 ? linearised.jacobian_a.col(axis) : linearised.jacobian_b.col(axis);
        EXPECT_LT((numeric - analytic).norm(), 1e-7);
      }
    }
  }
}

TEST(SpaceGraphTest, ConvergesFromNoisyPosesAndFromTheTree) {
  SpaceGraph graph = RandomSpaceGraph(52, 60);
  SpaceGraph by_tree = graph;
  PlaceByTree(BreadthFirstTree(by_tree), by_tree);
  const OptimizationSummary summary = OptimizeSparse(graph, SparseOptions{});
  const OptimizationSummary from_tree = OptimizeSparse(by_tree, SparseOptions{});
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(summary.chi2_after, 0.01 * summary.chi2_before);
  EXPECT_NEAR(from_tree.chi2_after, summary.chi2_after, 1e-6 * summary.chi2_after);
}

Pose3 Turned(double about_z_rad) {
  return {Eigen::Vector3d(1.0, 0.0, 0.0),
          Eigen::Quaterniond(Cos(0.5 * about_z_rad), 0.0, 0.0, Sin(0.5 * about_z_rad))};
}

TEST(SpaceGraphTest, DuplicateConstraintsCountTwiceAndHalfTurnsConverge) {
  SpaceGraph graph;
  graph.map_from_node = {Pose3{}, Turned(3.0)};
  graph.constraints = {{.to = 1, .from_from_to = Turned(kPi)},
                       {.to = 1, .from_from_to = Turned(-kPi)},
                       {.to = 1, .from_from_to = Turned(0.3 - kPi)}};
  graph.constraints[2].information *= 2.0;
  EXPECT_TRUE(OptimizeSparse(graph, SparseOptions{}).converged);
  const Pose3 off = Inverse(Turned(kPi + 0.15)) * graph.map_from_node[1];
  EXPECT_LT(off.rotation.vec().norm(), 1e-9);
}

TEST(SpaceGraphTest, TakesGraphsThatAreHardlyGraphs) {
  SpaceGraph graph;
  EXPECT_TRUE(OptimizeSparse(graph, SparseOptions{}).converged);
  graph.map_from_node = {Turned(1.0), Turned(2.0)};  // each holds itself
  graph.points_in_map = {{3.0, 4.0, 5.0}};           // and nobody has seen it
  EXPECT_TRUE(OptimizeSparse(graph, SparseOptions{}).converged);
  EXPECT_EQ(graph.points_in_map[0], Eigen::Vector3d(3.0, 4.0, 5.0));
  graph.constraints.push_back({.to = 1});  // which says nothing
  graph.constraints[0].information.setZero();
  EXPECT_EQ(CountZeroInformation(graph), 1U);
  EXPECT_EQ(OptimizeSparse(graph, SparseOptions{}).cost_after, 0.0);
  EXPECT_TRUE(graph.map_from_node[1].translation.allFinite());
}

TEST(SpaceGraphTest, ReadsBackWhatItPrints) {
  G2oGraph graph;
  graph.space = RandomSpaceGraph(53, 20);
  graph.space.fixed = {true};
  for (std::int64_t i = 0; i < 20; ++i) {
    graph.space_ids.push_back(i);
  }
  const StatusOr<G2oGraph> back = ParseG2o(*PrintG2o(graph));
  ASSERT_THAT(back, IsOk());
  const double chi2 = Chi2(graph.space);
  EXPECT_NEAR(Chi2(back->space), chi2, 1e-12 * chi2);
  EXPECT_TRUE(back->space.fixed[0]);
}

TEST(SpaceGraphTest, RefusesWhatIsNoGraph) {
  SpaceGraph graph = RandomSpaceGraph(54, 5);
  EXPECT_THAT(ValidateGraph(graph), IsOk());
  graph.constraints[1].to = graph.constraints[1].from;
  EXPECT_THAT(ValidateGraph(graph), IsStatus(StatusCode::kInvalidArgument, "constraints[1]"));
}

TEST(SpaceGraphTest, ReachesTheBestKnownChi2OfPublicGraphs) {
  for (const auto& [name, best] :
       {std::pair{"smallGrid3D", 458.154}, {"parking-garage", 1.23869}}) {
    LOCI_DATASET_OR_SKIP(text, std::string("graphs/") + name + ".g2o.gz");
    StatusOr<G2oGraph> graph = ParseG2o(text);
    ASSERT_THAT(graph, IsOk());
    EXPECT_LT(OptimizeSparse(graph->space, SparseOptions{}).chi2_after, 1.0001 * best) << name;
  }
}

}  // namespace
}  // namespace loci
