// SPDX-License-Identifier: Apache-2.0
// Absolute priors, fixed points, and points in space: errors, Jacobians, optima.
#include <algorithm>

#include <gtest/gtest.h>

#include "core/graph/plane_problem.h"
#include "core/graph/space_problem.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_space_graph.h"

namespace loci {
namespace {

constexpr double kStep = 1e-6;

Pose2 Perturbed(const Pose2& pose, int axis, double by) {
  Eigen::Vector3d xi = Eigen::Vector3d::Zero();
  xi(axis) = by;
  return pose * Exp(xi);
}

// Holds the Jacobian of a term at node 0 against differences of its error.
template <typename Graph, typename Term, typename Jacobian>
void ExpectNumericJacobian(const Graph& graph, const Term& term, const Jacobian& jacobian) {
  for (int axis = 0; axis < jacobian.cols(); ++axis) {
    Graph plus = graph;
    Graph minus = graph;
    plus.map_from_node[0] = Perturbed(graph.map_from_node[0], axis, kStep);
    minus.map_from_node[0] = Perturbed(graph.map_from_node[0], axis, -kStep);
    const auto numeric = ((ErrorOf(plus, term) - ErrorOf(minus, term)) / (2.0 * kStep)).eval();
    EXPECT_LT((numeric - jacobian.col(axis)).norm(), 1e-7) << "axis " << axis;
  }
}

// Holds chi2 at a result against chi2 beside it.
template <typename Graph>
void ExpectMinimum(const Graph& optimum, int axes) {
  for (std::size_t node = 0; node < optimum.map_from_node.size(); ++node) {
    for (int axis = 0; axis < axes; ++axis) {
      Graph graph = optimum;
      graph.map_from_node[node] = Perturbed(optimum.map_from_node[node], axis, kStep);
      const double plus = Chi2(graph);
      graph.map_from_node[node] = Perturbed(optimum.map_from_node[node], axis, -kStep);
      EXPECT_NEAR((plus - Chi2(graph)) / (2.0 * kStep), 0.0, 0.1) << "node " << node;
    }
  }
}

TEST(PriorTest, ErrorsAreThoseOfG2o) {
  PoseGraph graph;
  graph.map_from_node = {Pose2{1.0, 4.0, 0.5 * kPi + 0.1}};
  // Measured: 2 m below, looking up. Seen from there the node is 2 m ahead.
  const PosePrior pose{.map_from_node = {1.0, 2.0, 0.5 * kPi}};
  EXPECT_LT((ErrorOf(graph, pose) - Eigen::Vector3d(2.0, 0.0, 0.1)).norm(), 1e-12);
  const PositionPrior position{.node_in_map = {0.0, 1.0}};
  EXPECT_EQ(ErrorOf(graph, position), Eigen::Vector2d(1.0, 3.0));
  graph.pose_priors = {pose};
  graph.position_priors = {position};
  EXPECT_NEAR(Chi2(graph), 4.01 + 10.0, 1e-12);
}

TEST(PriorTest, JacobiansInThePlaneAreTheNumericOnes) {
  RandomSequence random(201);
  for (int trial = 0; trial < 100; ++trial) {
    PoseGraph graph;
    graph.map_from_node = {RandomPose(random, 5.0, kPi)};
    const PosePrior pose{.map_from_node = graph.map_from_node[0] * RandomPose(random, 1.0, 1.0)};
    EXPECT_EQ(Linearised(graph, pose).error, ErrorOf(graph, pose));
    ExpectNumericJacobian(graph, pose, Linearised(graph, pose).jacobian);
    const PositionPrior position{.node_in_map = RandomPose(random, 5.0, kPi).translation()};
    EXPECT_EQ(Linearised(graph, position).error, ErrorOf(graph, position));
    ExpectNumericJacobian(graph, position, Linearised(graph, position).jacobian);
  }
}

TEST(PriorTest, JacobiansInSpaceAreTheNumericOnes) {
  RandomSequence random(202);
  for (int trial = 0; trial < 100; ++trial) {
    SpaceGraph graph;
    graph.map_from_node = {RandomPose3(random, 5.0, 3.0)};
    graph.points_in_map = {RandomPose3(random, 5.0, 3.0).translation};
    SpacePosePrior pose;
    pose.node_from_sensor = RandomPose3(random, 1.0, 2.0);
    pose.map_from_sensor =
        graph.map_from_node[0] * pose.node_from_sensor * RandomPose3(random, 1.0, 0.7);
    EXPECT_EQ(Linearised(graph, pose).error, ErrorOf(graph, pose));
    ExpectNumericJacobian(graph, pose, Linearised(graph, pose).jacobian);
    const SpacePositionPrior position{.node_in_map = RandomPose3(random, 5.0, 0.0).translation};
    ExpectNumericJacobian(graph, position, Linearised(graph, position).jacobian);

    SpacePointConstraint constraint;
    constraint.point_in_from = RandomPose3(random, 5.0, 0.0).translation;
    const LinearisedPair<3, 6, 3> linearised = Linearised(graph, constraint);
    EXPECT_EQ(linearised.error, ErrorOf(graph, constraint));
    ExpectNumericJacobian(graph, constraint, linearised.jacobian_a);
    for (int axis = 0; axis < 3; ++axis) {
      SpaceGraph moved = graph;
      moved.points_in_map[0](axis) += kStep;
      const Eigen::Vector3d numeric =
          (ErrorOf(moved, constraint) - ErrorOf(graph, constraint)) / kStep;
      EXPECT_LT((numeric - linearised.jacobian_b.col(axis)).norm(), 1e-7);
    }
  }
}

TEST(PriorTest, TheGradientIsZeroAtTheResult) {
  PoseGraph graph = RandomLoopGraph(203, 60);
  graph.fixed.clear();
  AddPoints(204, 10, graph);
  AddPriors(205, graph);
  const OptimizationSummary summary = OptimizeSparse(graph, SparseOptions{});
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(summary.chi2_after, 0.8 * summary.chi2_before);
  ExpectMinimum(graph, 3);
}

TEST(PriorTest, TheGradientIsZeroAtTheResultInSpace) {
  SpaceGraph graph = RandomSpaceGraph(206, 40);
  AddPoints(207, 10, graph);
  AddPriors(208, graph);
  SpaceGraph moved = graph;
  const OptimizationSummary summary = OptimizeSparse(graph, SparseOptions{});
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(summary.chi2_after, 0.1 * summary.chi2_before);
  ExpectMinimum(graph, 6);
}

TEST(PriorTest, MovingThePriorsTooMovesTheResult) {
  PoseGraph graph = RandomLoopGraph(209, 60);
  graph.fixed.clear();
  AddPriors(210, graph);
  const Pose2 new_from_old{100.0, -50.0, 2.0};
  PoseGraph moved = Moved(new_from_old, graph);
  OptimizeSparse(graph, SparseOptions{});
  OptimizeSparse(moved, SparseOptions{});
  EXPECT_NEAR(Chi2(moved), Chi2(graph), 1e-6 * Chi2(graph));
  const PoseGraph expected = Moved(new_from_old, graph);
  for (std::size_t i = 0; i < expected.map_from_node.size(); ++i) {
    EXPECT_LT((Inverse(expected.map_from_node[i]) * moved.map_from_node[i]).vector().norm(), 1e-5);
  }
}

TEST(PriorTest, AMapFarFromItsPriorsIsBroughtThereAtOnce) {
  PoseGraph graph = RandomLoopGraph(217, 60);
  graph.fixed.clear();
  AddPoints(218, 10, graph);
  AddPriors(219, graph);
  PoseGraph far = graph;
  for (Pose2& pose : far.map_from_node) {
    pose = Pose2{300.0, -200.0, 2.5} * pose;
  }
  const OptimizationSummary from_near = OptimizeSparse(graph, SparseOptions{});
  const double far_chi2 = Chi2(far);
  const OptimizationSummary from_far = OptimizeSparse(far, SparseOptions{});
  EXPECT_EQ(from_far.chi2_before, far_chi2);
  EXPECT_NEAR(from_far.chi2_after, from_near.chi2_after, 1e-6 * from_near.chi2_after);
  EXPECT_LE(from_far.iterations, from_near.iterations + 3);
}

TEST(PriorTest, AMapFarFromItsPriorsIsBroughtThereAtOnceInSpace) {
  SpaceGraph graph = RandomSpaceGraph(220, 30);
  AddPriors(221, graph);
  graph.pose_priors.resize(1);
  SpaceGraph far = graph;
  RandomSequence random(222);
  const Pose3 motion = RandomPose3(random, 100.0, 3.0);
  for (Pose3& pose : far.map_from_node) {
    pose = motion * pose;
  }
  const OptimizationSummary from_near = OptimizeSparse(graph, SparseOptions{});
  const OptimizationSummary from_far = OptimizeSparse(far, SparseOptions{});
  EXPECT_NEAR(from_far.chi2_after, from_near.chi2_after, 1e-6 * from_near.chi2_after);
  EXPECT_LE(from_far.iterations, from_near.iterations + 3);
}

TEST(PriorTest, AKernelKeepsOneWrongFixFromBendingTheMap) {
  PoseGraph graph = RandomLoopGraph(211, 80);
  graph.fixed.clear();
  AddPriors(212, graph);
  PoseGraph wrong = graph;
  wrong.position_priors.push_back(
      {17,
       graph.map_from_node[17].translation() + Eigen::Vector2d(60.0, 0.0),
       Eigen::Matrix2d::Identity(),
       true});
  PoseGraph bent = wrong;
  OptimizeSparse(graph, SparseOptions{});
  OptimizeSparse(bent, SparseOptions{});
  SparseOptions robust;
  robust.kernel = {RobustKernel::Shape::kCauchy, 3.0};
  OptimizeSparse(wrong, robust);
  const auto off = [&](const PoseGraph& other) {
    return (other.map_from_node[17].translation() - graph.map_from_node[17].translation()).norm();
  };
  EXPECT_GT(off(bent), 0.5);
  EXPECT_LT(off(wrong), 0.05);
}

TEST(PriorTest, FixedPointsStayAndHoldTheMap) {
  PoseGraph graph = RandomLoopGraph(213, 40);
  AddPoints(214, 3, graph);
  graph.fixed.clear();
  graph.fixed_points = {true, false, true};
  graph.points_in_map[0] += Eigen::Vector2d(10.0, 0.0);
  graph.points_in_map[2] += Eigen::Vector2d(10.0, 0.0);
  const PoseGraph before = graph;
  EXPECT_TRUE(OptimizeSparse(graph, SparseOptions{}).converged);
  EXPECT_EQ(graph.points_in_map[0], before.points_in_map[0]);
  EXPECT_EQ(graph.points_in_map[2], before.points_in_map[2]);
  // All else has followed them.
  EXPECT_NEAR(graph.points_in_map[1].x(), before.points_in_map[1].x() + 10.0, 1.0);
  EXPECT_NEAR(graph.map_from_node[0].x, before.map_from_node[0].x + 10.0, 1.0);
  ExpectMinimum(graph, 3);
}

TEST(PriorTest, FixedPointsStayInSpace) {
  SpaceGraph graph = RandomSpaceGraph(215, 30);
  AddPoints(216, 4, graph);
  graph.fixed_points = {true, true, true};
  const SpaceGraph before = graph;
  EXPECT_TRUE(OptimizeSparse(graph, SparseOptions{}).converged);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(graph.points_in_map[i], before.points_in_map[i]);
  }
  EXPECT_NE(graph.points_in_map[3], before.points_in_map[3]);
  ExpectMinimum(graph, 6);
}

}  // namespace
}  // namespace loci
