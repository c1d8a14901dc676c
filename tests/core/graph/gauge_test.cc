// SPDX-License-Identifier: Apache-2.0
// What ties a component to the map.
#include "core/graph/gauge.h"

#include <algorithm>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "core/graph/space_problem.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_space_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

// A loop that nothing ties to the map.
PoseGraph FreeLoop(std::uint64_t seed) {
  PoseGraph graph = RandomLoopGraph(seed, 40);
  graph.fixed.clear();
  return graph;
}

std::size_t HeldCount(const std::vector<bool>& held) {
  return static_cast<std::size_t>(std::count(held.begin(), held.end(), true));
}

PositionPrior FixOf(const PoseGraph& graph, std::uint32_t node, double east_m) {
  PositionPrior fix;
  fix.node = node;
  fix.node_in_map = graph.map_from_node[node].translation() + Eigen::Vector2d(east_m, 0.0);
  return fix;
}

// Rank of what a tie says.
template <int kSize>
int RankOf(const GaugeTie<kSize>& tie) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, kSize, kSize>> solver(
      tie.information, Eigen::EigenvaluesOnly);
  return static_cast<int>(
      (solver.eigenvalues().array() > 1e-6 * solver.eigenvalues().maxCoeff()).count());
}

TEST(GaugeTest, HoldsTheLowestNodeOfWhatNothingTies) {
  const PoseGraph graph = FreeLoop(301);
  const Gauge<3> gauge = FindGauge(graph);
  EXPECT_EQ(HeldCount(gauge.held), 1U);
  EXPECT_TRUE(gauge.held[0]);
  EXPECT_TRUE(gauge.ties.empty());
}

TEST(GaugeTest, HoldsNothingWhereAPoseIsKnown) {
  PoseGraph graph = FreeLoop(302);
  graph.pose_priors.push_back({.node = 5, .map_from_node = {1.0, 2.0, 3.0}});
  const Gauge<3> gauge = FindGauge(graph);
  EXPECT_EQ(HeldCount(gauge.held), 0U);
  EXPECT_TRUE(gauge.ties.empty());
  // The prior costs nothing: the whole map goes where it says.
  PoseGraph without = FreeLoop(302);
  OptimizeSparse(graph, SparseOptions{});
  OptimizeSparse(without, SparseOptions{});
  EXPECT_NEAR(Chi2(graph), Chi2(without), 1e-6 * Chi2(without));
  EXPECT_LT(ErrorOf(graph, graph.pose_priors[0]).norm(), 1e-5);
}

TEST(GaugeTest, OneFixLeavesATurnOpenAndTwoLeaveNothing) {
  PoseGraph graph = FreeLoop(303);
  graph.position_priors.push_back(FixOf(graph, 7, 100.0));
  const Gauge<3> one = FindGauge(graph);
  EXPECT_EQ(HeldCount(one.held), 0U);
  ASSERT_EQ(one.ties.size(), 1U);
  EXPECT_EQ(one.ties[0].node, 7U);
  EXPECT_EQ(RankOf(one.ties[0]), 1);
  EXPECT_GT(one.ties[0].information(2, 2), 0.0);
  PoseGraph without = FreeLoop(303);
  const OptimizationSummary summary = OptimizeSparse(graph, SparseOptions{});
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(summary.iterations, 10);
  OptimizeSparse(without, SparseOptions{});
  EXPECT_NEAR(Chi2(graph), Chi2(without), 1e-6 * Chi2(without));
  EXPECT_LT(ErrorOf(graph, graph.position_priors[0]).norm(), 1e-5);

  graph.position_priors.push_back(FixOf(graph, 8, 0.0));
  const Gauge<3> two = FindGauge(graph);
  EXPECT_EQ(HeldCount(two.held), 0U);
  EXPECT_TRUE(two.ties.empty());
}

TEST(GaugeTest, ZeroInformationTiesNothing) {
  PoseGraph graph = FreeLoop(304);
  graph.pose_priors.push_back({.node = 5, .information = Eigen::Matrix3d::Zero()});
  EXPECT_TRUE(FindGauge(graph).held[0]);
}

TEST(GaugeTest, EachComponentIsTiedForItself) {
  PoseGraph graph;
  graph.map_from_node.resize(6);
  for (const std::uint32_t from : {0U, 2U, 4U}) {
    graph.constraints.push_back({.from = from, .to = from + 1});
  }
  graph.fixed = {false, true};
  graph.pose_priors.push_back({.node = 5});
  const Gauge<3> gauge = FindGauge(graph);
  EXPECT_EQ(gauge.held, (std::vector<bool>{false, true, true, false, false, false}));
  EXPECT_TRUE(gauge.ties.empty());
  EXPECT_EQ(HeldNodes(graph), gauge.held);
}

TEST(GaugeTest, AFixedPointLeavesATurnAboutItAndTwoLeaveNothing) {
  PoseGraph graph = FreeLoop(305);
  AddPoints(306, 2, graph);
  graph.fixed_points = {true};
  const Gauge<3> one = FindGauge(graph);
  EXPECT_EQ(HeldCount(one.held), 0U);
  ASSERT_EQ(one.ties.size(), 1U);
  EXPECT_EQ(RankOf(one.ties[0]), 1);
  EXPECT_TRUE(OptimizeSparse(graph, SparseOptions{}).converged);
  graph.fixed_points = {true, true};
  EXPECT_TRUE(FindGauge(graph).ties.empty());
}

TEST(GaugeTest, InSpaceEachFixTakesItsDirections) {
  SpaceGraph graph = RandomSpaceGraph(307, 20);
  const double free_chi2 = [&] {
    SpaceGraph copy = graph;
    return OptimizeSparse(copy, SparseOptions{}).chi2_after;
  }();
  EXPECT_TRUE(FindGauge(graph).held[0]);
  // Three rotations are open with one fix, one with two, none with three.
  for (const int open : {3, 1, 0}) {
    const auto node = static_cast<std::uint32_t>(5 + graph.position_priors.size());
    graph.position_priors.push_back({node, graph.map_from_node[node].translation});
    const Gauge<6> gauge = FindGauge(graph);
    EXPECT_EQ(HeldCount(gauge.held), 0U);
    ASSERT_EQ(gauge.ties.size(), open == 0 ? 0U : 1U);
    if (open > 0) {
      EXPECT_EQ(RankOf(gauge.ties[0]), open);
    }
    SpaceGraph copy = graph;
    const OptimizationSummary summary = OptimizeSparse(copy, SparseOptions{});
    EXPECT_TRUE(summary.converged);
    if (open == 3) {
      EXPECT_NEAR(summary.chi2_after, free_chi2, 1e-6 * free_chi2);
    }
  }
}

}  // namespace
}  // namespace loci
