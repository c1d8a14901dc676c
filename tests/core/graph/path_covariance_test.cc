// SPDX-License-Identifier: Apache-2.0
// Covariances along paths, against compounding and against the factorised graph.
#include "core/graph/path_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "core/geometry/covariance.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

std::vector<bool> AllConstraints(const PoseGraph& graph) {
  return std::vector<bool>(graph.constraints.size(), true);
}

// A chain whose constraints point either way.
PoseGraph RandomChain(std::uint64_t seed, std::uint32_t node_count) {
  RandomSequence random(seed);
  PoseGraph graph;
  graph.map_from_node = {RandomPose(random, 5.0, kPi)};
  for (std::uint32_t i = 1; i < node_count; ++i) {
    const Pose2 step = RandomPose(random, 3.0, kPi);
    graph.map_from_node.push_back(graph.map_from_node.back() * step);
    GraphConstraint constraint{i - 1, i, step, RandomInformation(random), false};
    if (i % 3 == 0) {
      constraint = {i, i - 1, Inverse(step), constraint.information, false};
    }
    graph.constraints.push_back(constraint);
  }
  return graph;
}

TEST(PathCovarianceTest, OfAChainIsTheCompoundedOneInBothDirections) {
  const PoseGraph graph = RandomChain(31, 12);
  PathCovariance paths(graph);
  paths.Use(AllConstraints(graph));
  StatusOr<GraphCovariance> exact = GraphCovariance::Compute(graph, RobustKernel{});
  ASSERT_THAT(exact, IsOk());
  for (const auto& [from, to] : {std::pair{0U, 11U}, {11U, 0U}, {3U, 8U}, {7U, 7U}}) {
    paths.Search(from);
    ASSERT_TRUE(paths.IsFound(to));
    const Eigen::Matrix3d expected =
        from == to ? Eigen::Matrix3d::Zero() : exact->Relative(from, to);
    EXPECT_LE((paths.CovarianceTo(to) - expected).norm(), 2e-9 * expected.norm())
        << from << " to " << to;
  }
}

// The smallest eigenvalue of how much larger the covariance along the path is than the exact one,
// over the size of the exact one.
double SmallestExcess(const PathCovariance& paths,
                      std::uint32_t from,
                      std::uint32_t to,
                      GraphCovariance& exact) {
  const Eigen::Matrix3d relative = exact.Relative(from, to);
  const Eigen::Matrix3d excess = paths.CovarianceTo(to) - relative;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(excess, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().minCoeff() / relative.norm();
}

TEST(PathCovarianceTest, OfNoPairIsSmallerThanTheExactRelativeCovariance) {
  for (const std::uint64_t seed : {32U, 33U, 34U}) {
    PoseGraph graph = RandomLoopGraph(seed, 60);
    for (const bool optimised : {false, true}) {  // also where errors are large
      if (optimised) {
        AddPriors(seed, graph);
        OptimizeSparse(graph, SparseOptions{});
      }
      StatusOr<GraphCovariance> exact = GraphCovariance::Compute(graph, RobustKernel{});
      ASSERT_THAT(exact, IsOk());
      PathCovariance paths(graph);
      paths.Use(AllConstraints(graph));
      for (std::uint32_t from = 0; from < 60; ++from) {
        paths.Search(from);
        for (std::uint32_t to = 0; to < 60; ++to) {
          if (to != from) {
            EXPECT_GE(SmallestExcess(paths, from, to, *exact), 0.0)
                << "seed " << seed << ": " << from << " to " << to;
          }
        }
      }
    }
  }
}

TEST(PathCovarianceTest, FindsTheNearestFirstAndOnlySoMany) {
  const PoseGraph graph = RandomLoopGraph(33, 200);
  std::vector<bool> odometry;
  for (const GraphConstraint& constraint : graph.constraints) {
    odometry.push_back(!constraint.robust);
  }
  PathCovariance paths(graph);
  paths.Use(odometry);
  paths.Search(100, 5);
  ASSERT_EQ(paths.Found().size(), 5U);
  EXPECT_EQ(paths.Found().front(), 100U);
  for (const std::uint32_t node : {98U, 99U, 101U, 102U}) {
    EXPECT_TRUE(paths.IsFound(node));
  }
  EXPECT_FALSE(paths.IsFound(103));
  paths.Search(0, 5);
  EXPECT_FALSE(paths.IsFound(100));
  EXPECT_TRUE(paths.IsFound(4));
}

TEST(PathCovarianceTest, PassesOverWhatIsNotUsedAndWhatSaysNothingInSomeDirection) {
  PoseGraph graph = RandomChain(34, 4);
  graph.constraints[1].information(2, 2) = 0.0;
  graph.constraints[1].information.row(2).setZero();
  graph.constraints[1].information.col(2).setZero();
  PathCovariance paths(graph);
  paths.Use(AllConstraints(graph));
  paths.Search(0);
  EXPECT_EQ(paths.Found(), (std::vector<std::uint32_t>{0, 1}));
  paths.Use({true, true, false});
  paths.Search(3);
  EXPECT_EQ(paths.Found(), (std::vector<std::uint32_t>{3}));
}

}  // namespace
}  // namespace loci
