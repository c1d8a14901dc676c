// SPDX-License-Identifier: Apache-2.0
// Our optimum is Ceres' optimum.
#include <gtest/gtest.h>

#include "clients/cli/ceres/ceres_optimizer.h"
#include "core/graph/g2o_format.h"
#include "core/graph/optimize.h"
#include "core/graph/space_problem.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_space_graph.h"
#include "tests/support/datasets.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

// Constraints, points and priors weigh about the same; some say nothing in one direction.
template <typename Graph>
void Weigh(std::uint64_t seed, Graph& graph) {
  RandomSequence random(seed);
  for (auto& constraint : graph.constraints) {
    constraint.information *= random.NextUniform(0.5, 2.0);
  }
  for (std::size_t i = 0; i < graph.point_constraints.size(); i += 7) {
    graph.point_constraints[i].information.row(1).setZero();
    graph.point_constraints[i].information.col(1).setZero();
  }
}

void ExpectSameOptimum(const PoseGraph& graph) {
  PoseGraph ours = graph;
  PoseGraph theirs = graph;
  ASSERT_THAT(OptimizeGraph(ours, OptimizeOptions{}), IsOk());
  const OptimizationSummary summary = OptimizeByCeres(theirs, CeresOptions{});
  EXPECT_TRUE(summary.converged);
  EXPECT_EQ(summary.chi2_before, Chi2(graph));
  EXPECT_EQ(summary.chi2_after, Chi2(theirs));
  EXPECT_NEAR(Chi2(ours), Chi2(theirs), 1e-6 * Chi2(theirs));
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    EXPECT_LT((Inverse(ours.map_from_node[i]) * theirs.map_from_node[i]).vector().norm(), 1e-3)
        << "node " << i;
  }
  for (std::size_t i = 0; i < graph.points_in_map.size(); ++i) {
    EXPECT_LT((ours.points_in_map[i] - theirs.points_in_map[i]).norm(), 1e-3) << "point " << i;
  }
}

TEST(CeresReferenceTest, FindsTheSameOptimumOfRandomGraphs) {
  for (const std::uint64_t seed : {71U, 72U, 73U}) {
    PoseGraph graph = RandomLoopGraph(seed, 100);
    RandomSequence random(seed);
    for (GraphConstraint& constraint : graph.constraints) {
      constraint.information = 50.0 * RandomInformation(random);
    }
    ExpectSameOptimum(graph);
  }
}

TEST(CeresReferenceTest, FindsTheSameOptimumWithPointsPriorsAndFixedPoints) {
  for (const std::uint64_t seed : {74U, 75U, 76U}) {
    PoseGraph graph = RandomLoopGraph(seed, 100);
    AddPoints(seed + 10, 20, graph);
    AddPriors(seed + 20, graph);
    Weigh(seed + 30, graph);
    graph.fixed.clear();
    graph.fixed_points = {true, false, true};
    ExpectSameOptimum(graph);
  }
}

TEST(CeresReferenceTest, FindsTheSameOptimumInSpace) {
  for (const std::uint64_t seed : {77U, 78U, 79U}) {
    SpaceGraph graph = RandomSpaceGraph(seed, 60);
    AddPoints(seed + 10, 10, graph);
    AddPriors(seed + 20, graph);
    Weigh(seed + 30, graph);
    SpaceGraph ours = graph;
    OptimizeSparse(ours, SparseOptions{});
    EXPECT_TRUE(OptimizeByCeres(graph, CeresOptions{}).converged);
    EXPECT_NEAR(Chi2(ours), Chi2(graph), 1e-6 * Chi2(graph));
  }
}

TEST(CeresReferenceTest, StopsAtTheChi2ThatItIsGiven) {
  const PoseGraph start = RandomLoopGraph(80, 100);
  PoseGraph optimum = start;
  const OptimizationSummary whole = OptimizeByCeres(optimum, CeresOptions{});
  PoseGraph graph = start;
  const double enough = 1.5 * whole.chi2_after;
  const OptimizationSummary part = OptimizeByCeres(graph, {.stop_at_chi2 = enough});
  EXPECT_LE(part.chi2_after, enough);
  EXPECT_LT(part.iterations, whole.iterations);
}

TEST(CeresReferenceTest, TakesGraphsThatAreHardlyGraphs) {
  PoseGraph graph;
  OptimizeByCeres(graph, CeresOptions{});
  graph.map_from_node.resize(3);
  graph.points_in_map.resize(1, Eigen::Vector2d::Zero());
  graph.constraints.push_back({.from = 2, .to = 1, .information = Eigen::Matrix3d::Zero()});
  OptimizeByCeres(graph, CeresOptions{});
  EXPECT_THAT(ValidateGraph(graph), IsOk());
}

TEST(CeresReferenceTest, FindsTheSameOptimumOfIntel) {
  LOCI_DATASET_OR_SKIP(text, "graphs/intel_g2o.g2o.gz");
  const StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_THAT(parsed, IsOk());
  ExpectSameOptimum(parsed->plane);
}

TEST(CeresReferenceTest, FindsTheSameOptimumOfTheSmallGrid) {
  LOCI_DATASET_OR_SKIP(text, "graphs/smallGrid3D.g2o.gz");
  StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_THAT(parsed, IsOk());
  SpaceGraph ours = parsed->space;
  OptimizeSparse(ours, SparseOptions{});
  OptimizeByCeres(parsed->space, CeresOptions{});
  EXPECT_NEAR(Chi2(ours), Chi2(parsed->space), 1e-6 * Chi2(ours));
}

}  // namespace
}  // namespace loci
