// SPDX-License-Identifier: Apache-2.0
// Constraints between many nodes: errors, Jacobians, optima, and what stands in for them.
#include "core/graph/joint_constraint.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "core/graph/g2o_format.h"
#include "core/graph/graph_start.h"
#include "core/graph/robust_optimize.h"
#include "core/graph/sparse_optimizer.h"
#include "core/graph/toro_optimizer.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_joint.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

constexpr double kStep = 1e-6;

TEST(JointConstraintTest, JacobiansAreTheNumericOnes) {
  RandomSequence random(301);
  for (int trial = 0; trial < 50; ++trial) {
    PoseGraph graph;
    for (int i = 0; i < 4; ++i) {
      graph.map_from_node.push_back(RandomPose(random, 5.0, kPi));
    }
    const JointConstraint constraint = RandomJoint({2, 0, 3}, graph, 1.0, 1.0, random);
    const LinearisedJoint linearised = Linearised(graph, constraint);
    EXPECT_LT((linearised.error - ErrorOf(graph, constraint)).norm(), 1e-12);
    for (std::size_t i = 0; i < constraint.nodes.size(); ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        Eigen::Vector3d xi = Eigen::Vector3d::Zero();
        xi(axis) = kStep;
        PoseGraph plus = graph;
        PoseGraph minus = graph;
        Pose2& plus_pose = plus.map_from_node[constraint.nodes[i]];
        Pose2& minus_pose = minus.map_from_node[constraint.nodes[i]];
        plus_pose = plus_pose * Exp(xi);
        minus_pose = minus_pose * Exp(-xi);
        const Eigen::VectorXd numeric =
            (ErrorOf(plus, constraint) - ErrorOf(minus, constraint)) / (2.0 * kStep);
        EXPECT_LT(
            (numeric - linearised.jacobian.col(3 * static_cast<Eigen::Index>(i) + axis)).norm(),
            1e-7);
      }
    }
  }
}

TEST(JointConstraintTest, Chi2StaysUnderARigidMotionOfEverything) {
  PoseGraph graph = RandomLoopGraph(302, 30);
  RandomSequence random(303);
  graph.joint_constraints = {RandomJoint({1, 7, 20, 12}, graph, 0.3, 0.1, random)};
  const PoseGraph moved = Moved(Pose2{10.0, -20.0, 2.0}, graph);
  EXPECT_GT(Chi2Of(graph, graph.joint_constraints[0]), 0.1);
  EXPECT_NEAR(Chi2(moved), Chi2(graph), 1e-9 * Chi2(graph));
}

TEST(JointConstraintTest, IndependentPartsAreTheConstraintsOfPairs) {
  PoseGraph pairs = RandomLoopGraph(304, 40);
  PoseGraph joint = pairs;
  RandomSequence random(305);
  JointConstraint constraint = RandomJoint({30, 2, 11}, pairs, 0.3, 0.1, random);
  constraint.information.setZero();
  for (std::size_t i = 1; i < 3; ++i) {
    const Eigen::Matrix3d information = 30.0 * RandomInformation(random);
    const auto row = 3 * static_cast<Eigen::Index>(i - 1);
    constraint.information.block<3, 3>(row, row) = information;
    pairs.constraints.push_back({constraint.nodes[0],
                                 constraint.nodes[i],
                                 constraint.first_from_node[i - 1],
                                 information,
                                 false});
    EXPECT_LT((ImpliedPair(constraint, i).information - information).norm(), 1e-9);
  }
  joint.joint_constraints = {constraint};
  EXPECT_NEAR(Chi2(joint), Chi2(pairs), 1e-9 * Chi2(pairs));
  const double chi2 = OptimizeSparse(pairs, SparseOptions{}).chi2_after;
  EXPECT_NEAR(OptimizeSparse(joint, SparseOptions{}).chi2_after, chi2, 1e-8 * chi2);
  StatusOr<GraphCovariance> of_pairs = GraphCovariance::Compute(pairs, RobustKernel{});
  StatusOr<GraphCovariance> of_joint = GraphCovariance::Compute(joint, RobustKernel{});
  ASSERT_THAT(of_pairs, IsOk());
  ASSERT_THAT(of_joint, IsOk());
  for (const std::uint32_t node : {2U, 19U, 30U}) {
    EXPECT_LT((of_joint->Marginal(node) - of_pairs->Marginal(node)).norm(),
              1e-6 * of_pairs->Marginal(node).norm());
  }
}

TEST(JointConstraintTest, TheGradientIsZeroAtTheResultOfBothMethods) {
  for (const SparseOptions::Method method :
       {SparseOptions::Method::kGaussNewton, SparseOptions::Method::kLevenbergMarquardt}) {
    PoseGraph graph = RandomLoopGraph(306, 60);
    RandomSequence random(307);
    // With the node that is held, without it, and two that share nodes.
    for (const std::vector<std::uint32_t>& nodes :
         {std::vector<std::uint32_t>{0, 30, 12}, {55, 7, 33, 12}, {7, 33}}) {
      graph.joint_constraints.push_back(RandomJoint(nodes, graph, 0.3, 0.1, random));
    }
    SparseOptions options;
    options.method = method;
    EXPECT_TRUE(OptimizeSparse(graph, options).converged);
    const PoseGraph optimum = graph;
    for (std::size_t node = 1; node < graph.map_from_node.size(); ++node) {
      for (int axis = 0; axis < 3; ++axis) {
        Eigen::Vector3d xi = Eigen::Vector3d::Zero();
        xi(axis) = kStep;
        graph.map_from_node[node] = optimum.map_from_node[node] * Exp(xi);
        const double plus = Chi2(graph);
        graph.map_from_node[node] = optimum.map_from_node[node] * Exp(-xi);
        EXPECT_NEAR((plus - Chi2(graph)) / (2.0 * kStep), 0.0, 0.1) << "node " << node;
        graph.map_from_node[node] = optimum.map_from_node[node];
      }
    }
  }
}

TEST(JointConstraintTest, AmongHeldNodesItCountsAndMovesNothing) {
  PoseGraph graph;
  graph.map_from_node = {Pose2{}, Pose2{1.0, 0.0, 0.0}, Pose2{2.0, 0.0, 0.0}};
  graph.fixed = {true, true, true};
  RandomSequence random(308);
  graph.joint_constraints = {RandomJoint({0, 1, 2}, graph, 0.3, 0.1, random)};
  const double chi2 = Chi2(graph);
  const OptimizationSummary summary = OptimizeSparse(graph, SparseOptions{});
  EXPECT_TRUE(summary.converged);
  EXPECT_EQ(summary.chi2_after, chi2);
  EXPECT_GT(chi2, 0.0);
}

TEST(JointConstraintTest, ItJoinsItsNodesToOneComponent) {
  PoseGraph graph;
  graph.map_from_node.resize(5);
  graph.joint_constraints.resize(1);
  graph.joint_constraints[0].nodes = {3, 1, 4};
  EXPECT_EQ(FindComponents(graph).of_node, (std::vector<std::uint32_t>{0, 1, 2, 1, 1}));
  EXPECT_EQ(HeldNodes(graph), (std::vector<bool>{true, true, true, false, false}));
}

TEST(JointConstraintTest, ValidationNamesWhatIsWrong) {
  PoseGraph graph = RandomLoopGraph(309, 5);
  RandomSequence random(310);
  const JointConstraint valid = RandomJoint({0, 2, 3}, graph, 0.1, 0.1, random);
  const auto status_with = [&](const auto& change) {
    PoseGraph changed = graph;
    changed.joint_constraints = {valid, valid};
    change(changed.joint_constraints[1]);
    return ValidateGraph(changed);
  };
  EXPECT_THAT(status_with([](JointConstraint&) {}), IsOk());
  const auto refuses = [&](const auto& change, const char* what) {
    EXPECT_THAT(status_with(change), IsStatus(StatusCode::kInvalidArgument, what));
  };
  refuses([](JointConstraint& c) { c.nodes[1] = 5; }, "joint_constraints[1].nodes: 5, must be < 5");
  refuses([](JointConstraint& c) { c.nodes[2] = 0; }, "joint_constraints[1]: joins node 0");
  refuses([](JointConstraint& c) { c.nodes.resize(1); }, "joint_constraints[1]: 1 nodes");
  refuses([](JointConstraint& c) { c.first_from_node.resize(1); }, "3 nodes and 1 poses");
  refuses([](JointConstraint& c) { c.first_from_node[1].x = std::nan(""); }, "first_from_node");
  refuses([](JointConstraint& c) { c.information.resize(3, 3); }, "3 x 3, must be 6 x 6");
  refuses([](JointConstraint& c) { c.information(0, 1) += 5.0; }, "information: not symmetric");
  refuses([](JointConstraint& c) { c.information *= -1.0; }, "information: eigenvalue");
}

TEST(JointConstraintTest, SortingMakesEveryPermutationTheSame) {
  PoseGraph graph = RandomLoopGraph(311, 30);
  RandomSequence random(312);
  for (const std::vector<std::uint32_t>& nodes :
       {std::vector<std::uint32_t>{4, 9, 2}, {4, 9}, {4, 9, 2}, {1, 20, 5, 7}}) {
    graph.joint_constraints.push_back(RandomJoint(nodes, graph, 0.3, 0.1, random));
  }
  PoseGraph reversed = graph;
  std::reverse(reversed.joint_constraints.begin(), reversed.joint_constraints.end());
  EXPECT_NE(Chi2(graph), 0.0);
  for (PoseGraph* each : {&graph, &reversed}) {
    SortConstraints(*each);
    OptimizeSparse(*each, SparseOptions{});
  }
  EXPECT_EQ(graph.map_from_node, reversed.map_from_node);
}

TEST(JointConstraintTest, AnInformationOfZeroIsCounted) {
  PoseGraph graph = RandomLoopGraph(313, 5);
  RandomSequence random(314);
  graph.joint_constraints = {RandomJoint({0, 2, 3}, graph, 0.1, 0.1, random)};
  EXPECT_EQ(CountZeroInformation(graph), 0U);
  graph.joint_constraints[0].information.setZero();
  EXPECT_EQ(CountZeroInformation(graph), 1U);
}

TEST(JointConstraintTest, G2oRefusesItByName) {
  G2oGraph graph;
  graph.plane = RandomLoopGraph(315, 5);
  graph.node_ids = {0, 1, 2, 3, 4};
  EXPECT_THAT(PrintG2o(graph), IsOk());
  RandomSequence random(316);
  graph.plane.joint_constraints = {RandomJoint({0, 2, 3}, graph.plane, 0.1, 0.1, random)};
  EXPECT_THAT(PrintG2o(graph), IsStatus(StatusCode::kFailedPrecondition, "joint_constraints[0]"));
}

TEST(JointConstraintTest, AnImpliedPairHasTheCovarianceThatTheWholeGivesIt) {
  PoseGraph graph = RandomLoopGraph(317, 10);
  RandomSequence random(318);
  const JointConstraint constraint = RandomJoint({1, 2, 3, 4}, graph, 0.0, 0.0, random);
  const Eigen::MatrixXd covariance = constraint.information.inverse();
  for (std::size_t i = 1; i < 4; ++i) {
    const auto row = 3 * static_cast<Eigen::Index>(i - 1);
    const Eigen::Matrix3d expected = covariance.block<3, 3>(row, row).inverse();
    EXPECT_LT((ImpliedPair(constraint, i).information - expected).norm(), 1e-9 * expected.norm());
  }
}

TEST(JointConstraintTest, AnImpliedPairOfTwoNodesIsThatPair) {
  PoseGraph graph = RandomLoopGraph(321, 10);
  RandomSequence random(322);
  JointConstraint constraint = RandomJoint({7, 3}, graph, 0.3, 0.1, random);
  // One direction is as good as unknown, beside the others: nothing was taken away, so it stays.
  const Eigen::Vector3d known(1.0, 0.0, 1.0);
  const Eigen::Vector3d weak(1.0, 0.0, -1.0);
  constraint.information = 1e10 * known * known.transpose() + 1e-4 * weak * weak.transpose();
  const GraphConstraint pair = ImpliedPair(constraint, 1);
  EXPECT_EQ(pair.from, 7U);
  EXPECT_EQ(pair.to, 3U);
  EXPECT_EQ(pair.from_from_to, constraint.first_from_node[0]);
  EXPECT_EQ(pair.information, PairOf(constraint).information);
}

// A graph whose second half hangs on the first by a joint constraint alone.
PoseGraph HangingGraph() {
  PoseGraph graph = RandomLoopGraph(319, 20);
  graph.fixed.clear();
  std::erase_if(graph.constraints, [](const GraphConstraint& c) { return c.to == 10; });
  RandomSequence random(320);
  graph.joint_constraints = {RandomJoint({9, 12, 15}, graph, 0.02, 0.01, random)};
  for (std::size_t node = 10; node < 20; ++node) {  // and is far from where it should be
    graph.map_from_node[node] = Pose2{50.0, -30.0, 2.5} * graph.map_from_node[node];
  }
  return graph;
}

TEST(JointConstraintTest, TreesAndStartsGoAlongItsPairs) {
  PoseGraph graph = HangingGraph();
  PoseGraph by_tree = graph;
  PlaceByTree(BreadthFirstTree(graph), by_tree);
  EXPECT_LT((Inverse(Inverse(by_tree.map_from_node[9]) * by_tree.map_from_node[12]) *
             graph.joint_constraints[0].first_from_node[0])
                .vector()
                .norm(),
            1e-9);
  const double optimum = OptimizeSparse(by_tree, SparseOptions{}).chi2_after;
  for (const GraphStart start : StartsFor(graph)) {
    PoseGraph placed = graph;
    PlaceAtStart(start, placed);
    EXPECT_EQ(placed.joint_constraints.size(), 1U);
    EXPECT_NEAR(OptimizeSparse(placed, SparseOptions{}).chi2_after, optimum, 1e-6 * (1.0 + optimum))
        << GraphStartName(start);
  }
}

TEST(JointConstraintTest, RobustMethodsTrustItOrRefuseItByName) {
  const PoseGraph graph = HangingGraph();
  PoseGraph optimum = graph;
  PlaceAtStart(GraphStart::kTree, optimum);
  const double chi2 = OptimizeSparse(optimum, SparseOptions{}).chi2_after;
  for (const RobustMethod method : {RobustMethod::kHuber, RobustMethod::kGemanMcClure}) {
    PoseGraph robust = graph;
    RobustOptions options;
    options.method = method;
    ASSERT_THAT(OptimizeRobustly(robust, options), IsOk());
    EXPECT_NEAR(Chi2(robust), chi2, 1e-6 * (1.0 + chi2)) << RobustMethodName(method);
  }
  PoseGraph refused = graph;
  EXPECT_THAT(OptimizeRobustly(refused, RobustOptions{}),
              IsStatus(StatusCode::kFailedPrecondition, "joint_constraints[0]"));
  EXPECT_EQ(refused.map_from_node, graph.map_from_node);
}

TEST(JointConstraintTest, DescentLowersItsChi2) {
  PoseGraph graph = HangingGraph();
  graph.joint_constraints[0].information *= 100.0;  // as stiff as the loop that it is part of
  ToroOptimizer toro(graph);
  for (int i = 0; i < 20; ++i) {
    toro.Sweep();
  }
  PoseGraph swept = graph;
  swept.map_from_node = toro.Poses();
  EXPECT_LT(Chi2(swept), 0.01 * Chi2(graph));
}

}  // namespace
}  // namespace loci
