// SPDX-License-Identifier: Apache-2.0
// Gauss-Newton, its Jacobians, its covariances and its manners with degenerate graphs.
#include "core/graph/sparse_optimizer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "core/geometry/covariance.h"
#include "core/graph/normal_equations.h"
#include "core/graph/plane_problem.h"
#include "core/graph/toro_tree.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

constexpr double kStep = 1e-6;

Pose2 Perturbed(const Pose2& pose, int axis, double by) {
  Eigen::Vector3d xi = Eigen::Vector3d::Zero();
  xi(axis) = by;
  return pose * Exp(xi);
}

TEST(SparseOptimizerTest, JacobiansOfPoseConstraintsAreTheNumericOnes) {
  RandomSequence random(11);
  for (int trial = 0; trial < 100; ++trial) {
    PoseGraph graph;
    graph.map_from_node = {RandomPose(random, 5.0, kPi), RandomPose(random, 5.0, kPi)};
    GraphConstraint constraint;
    constraint.to = 1;
    // Near the truth, so that no error is near pi, where it jumps.
    constraint.from_from_to =
        Inverse(graph.map_from_node[0]) * graph.map_from_node[1] * RandomPose(random, 1.0, 1.0);
    const LinearisedPair<3, 3, 3> linearised = Linearised(graph, constraint);
    EXPECT_LT((linearised.error - ErrorOf(graph, constraint)).norm(), 1e-12);
    for (int axis = 0; axis < 3; ++axis) {
      for (const std::size_t node : {0U, 1U}) {
        PoseGraph plus = graph;
        PoseGraph minus = graph;
        plus.map_from_node[node] = Perturbed(graph.map_from_node[node], axis, kStep);
        minus.map_from_node[node] = Perturbed(graph.map_from_node[node], axis, -kStep);
        const Eigen::Vector3d numeric =
            (ErrorOf(plus, constraint) - ErrorOf(minus, constraint)) / (2.0 * kStep);
        const Eigen::Vector3d analytic =
            node == 0 ? linearised.jacobian_a.col(axis) : linearised.jacobian_b.col(axis);
        EXPECT_LT((numeric - analytic).norm(), 1e-7);
      }
    }
  }
}

TEST(SparseOptimizerTest, JacobiansOfPointConstraintsAreTheNumericOnes) {
  RandomSequence random(12);
  for (int trial = 0; trial < 100; ++trial) {
    PoseGraph graph;
    graph.map_from_node = {RandomPose(random, 5.0, kPi)};
    graph.points_in_map = {RandomPose(random, 5.0, kPi).translation()};
    PointConstraint constraint;
    constraint.point_in_from = RandomPose(random, 5.0, kPi).translation();
    const LinearisedPair<2, 3, 2> linearised = Linearised(graph, constraint);
    for (int axis = 0; axis < 3; ++axis) {
      PoseGraph plus = graph;
      PoseGraph minus = graph;
      plus.map_from_node[0] = Perturbed(graph.map_from_node[0], axis, kStep);
      minus.map_from_node[0] = Perturbed(graph.map_from_node[0], axis, -kStep);
      const Eigen::Vector2d numeric =
          (ErrorOf(plus, constraint) - ErrorOf(minus, constraint)) / (2.0 * kStep);
      EXPECT_LT((numeric - linearised.jacobian_a.col(axis)).norm(), 1e-7);
    }
    for (int axis = 0; axis < 2; ++axis) {
      PoseGraph plus = graph;
      PoseGraph minus = graph;
      plus.points_in_map[0](axis) += kStep;
      minus.points_in_map[0](axis) -= kStep;
      const Eigen::Vector2d numeric =
          (ErrorOf(plus, constraint) - ErrorOf(minus, constraint)) / (2.0 * kStep);
      EXPECT_LT((numeric - linearised.jacobian_b.col(axis)).norm(), 1e-7);
    }
  }
}

TEST(SparseOptimizerTest, TheTermOfTwoPosesHasTheBitsOfTheGeneralOne) {
  PoseGraph graph = RandomLoopGraph(21, 200);
  RandomSequence random(22);
  for (GraphConstraint& constraint : graph.constraints) {
    Eigen::Matrix3d root;
    for (int i = 0; i < 9; ++i) {
      root(i) = random.NextUniform(-10.0, 10.0);
    }
    constraint.information = root * root.transpose();
    const auto linearised = Linearised(graph, constraint);
    double expected[42] = {};
    double values[42] = {};
    WriteTerm(linearised, constraint.information, true, true, expected);
    WritePoseTerm(linearised, constraint.information, values);
    for (int i = 0; i < 42; ++i) {
      ASSERT_EQ(values[i], expected[i]) << "number " << i;
    }
  }
}

TEST(SparseOptimizerTest, TheGradientIsZeroAtTheResult) {
  PoseGraph graph = RandomLoopGraph(13, 100);
  AddPoints(14, 20, graph);
  const OptimizationSummary summary = OptimizeSparse(graph, SparseOptions{});
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(summary.chi2_after, 0.6 * summary.chi2_before);
  EXPECT_NEAR(summary.chi2_after, Chi2(graph), 1e-12 * summary.chi2_after);
  const PoseGraph optimum = graph;
  for (std::size_t node = 1; node < graph.map_from_node.size(); ++node) {
    for (int axis = 0; axis < 3; ++axis) {
      graph.map_from_node[node] = Perturbed(optimum.map_from_node[node], axis, kStep);
      const double plus = Chi2(graph);
      graph.map_from_node[node] = Perturbed(optimum.map_from_node[node], axis, -kStep);
      const double minus = Chi2(graph);
      graph.map_from_node[node] = optimum.map_from_node[node];
      EXPECT_NEAR((plus - minus) / (2.0 * kStep), 0.0, 0.1) << "node " << node;
    }
  }
}

TEST(SparseOptimizerTest, SameGraphSameBitsAndSortedPermutationsToo) {
  PoseGraph graph = RandomLoopGraph(15, 80);
  AddPoints(16, 10, graph);
  PoseGraph reversed = graph;
  std::reverse(reversed.constraints.begin(), reversed.constraints.end());
  std::reverse(reversed.point_constraints.begin(), reversed.point_constraints.end());
  SortConstraints(graph);
  SortConstraints(reversed);
  PoseGraph again = graph;
  for (PoseGraph* each : {&graph, &again, &reversed}) {
    OptimizeSparse(*each, SparseOptions{});
  }
  EXPECT_EQ(graph.map_from_node, again.map_from_node);
  EXPECT_EQ(graph.map_from_node, reversed.map_from_node);
  EXPECT_EQ(graph.points_in_map, reversed.points_in_map);
}

TEST(SparseOptimizerTest, MovingEverythingMovesTheResult) {
  const PoseGraph graph = RandomLoopGraph(17, 60);
  const Pose2 new_from_old{10.0, -20.0, 2.0};
  PoseGraph here = graph;
  PoseGraph there = Moved(new_from_old, graph);
  const double chi2 = OptimizeSparse(here, SparseOptions{}).chi2_after;
  EXPECT_NEAR(OptimizeSparse(there, SparseOptions{}).chi2_after, chi2, 1e-8 * chi2);
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    EXPECT_LT(
        (Inverse(new_from_old * here.map_from_node[i]) * there.map_from_node[i]).vector().norm(),
        1e-6);
  }
}

TEST(SparseOptimizerTest, FixedNodesStayAndNothingEndsWorse) {
  PoseGraph graph = RandomLoopGraph(18, 60);
  graph.fixed.assign(60, false);
  graph.fixed[5] = true;
  graph.fixed[40] = true;
  for (const SparseOptions::Method method :
       {SparseOptions::Method::kGaussNewton, SparseOptions::Method::kLevenbergMarquardt}) {
    PoseGraph moved = graph;
    SparseOptions options;
    options.method = method;
    const OptimizationSummary summary = OptimizeSparse(moved, options);
    EXPECT_TRUE(summary.converged);
    EXPECT_LT(summary.cost_after, summary.cost_before);
    EXPECT_EQ(moved.map_from_node[5], graph.map_from_node[5]);
    EXPECT_EQ(moved.map_from_node[40], graph.map_from_node[40]);
    EXPECT_NE(moved.map_from_node[0], graph.map_from_node[0]);
  }
}

TEST(SparseOptimizerTest, TurningFirstFindsTheHeadingsAndMovesNothing) {
  PoseGraph graph = RandomLoopGraph(4, 60);
  OptimizeSparse(graph, {});
  // As if it had no noise: what the constraints say is where the nodes are.
  for (GraphConstraint& constraint : graph.constraints) {
    constraint.from_from_to =
        Inverse(graph.map_from_node[constraint.from]) * graph.map_from_node[constraint.to];
  }
  PoseGraph turned = graph;
  RandomSequence random(5);
  for (std::size_t i = 1; i < turned.map_from_node.size(); ++i) {
    turned.map_from_node[i] = graph.map_from_node[i] * RandomPose(random, 20.0, 0.4);
  }
  const PoseGraph before = turned;
  PlaneProblem problem(turned, {});
  NormalEquations equations(problem.BlockSizes(), problem.Pairs());
  ASSERT_TRUE(problem.TurnToAgree(equations));
  for (std::size_t i = 0; i < turned.map_from_node.size(); ++i) {
    EXPECT_NEAR(WrapAngle(turned.map_from_node[i].theta - graph.map_from_node[i].theta), 0.0, 1e-9);
    EXPECT_EQ(turned.map_from_node[i].translation(), before.map_from_node[i].translation());
  }
  EXPECT_DOUBLE_EQ(problem.Cost(), Chi2(turned));
}

// What the headings turn is as measured: with headings that are right the positions follow in one
// linear step from anywhere.
TEST(SparseOptimizerTest, PlacingAfterTurningFindsExactPosesFromAnywhere) {
  PoseGraph graph = RandomLoopGraph(6, 60);
  OptimizeSparse(graph, {});
  for (GraphConstraint& constraint : graph.constraints) {
    constraint.from_from_to =
        Inverse(graph.map_from_node[constraint.from]) * graph.map_from_node[constraint.to];
  }
  RandomSequence random(7);
  PoseGraph placed = graph;
  for (std::size_t i = 1; i < placed.map_from_node.size(); ++i) {
    placed.map_from_node[i] = graph.map_from_node[i] * RandomPose(random, 500.0, 0.4);
  }
  PlaneProblem problem(placed, {});
  NormalEquations equations(problem.BlockSizes(), problem.Pairs());
  ASSERT_TRUE(problem.TurnToAgree(equations));
  ASSERT_TRUE(problem.PlaceToAgree(equations));
  for (std::size_t i = 0; i < placed.map_from_node.size(); ++i) {
    EXPECT_LT((placed.map_from_node[i].vector() - graph.map_from_node[i].vector()).norm(), 1e-8);
  }
  EXPECT_LT(Chi2(placed), 1e-12);
}

// With noise, too, where the nodes stood before makes no difference to where they are placed.
TEST(SparseOptimizerTest, PlacingAfterTurningForgetsThePositionsOfTheStart) {
  const PoseGraph graph = RandomLoopGraph(8, 80);
  RandomSequence random(9);
  PoseGraph near = graph;
  PoseGraph far = graph;
  for (std::size_t i = 1; i < far.map_from_node.size(); ++i) {
    far.map_from_node[i].x += random.NextUniform(-300.0, 300.0);
    far.map_from_node[i].y += random.NextUniform(-300.0, 300.0);
  }
  for (PoseGraph* each : {&near, &far}) {
    PlaneProblem problem(*each, {});
    NormalEquations equations(problem.BlockSizes(), problem.Pairs());
    ASSERT_TRUE(problem.TurnToAgree(equations));
    ASSERT_TRUE(problem.PlaceToAgree(equations));
  }
  for (std::size_t i = 0; i < far.map_from_node.size(); ++i) {
    EXPECT_LT((near.map_from_node[i].vector() - far.map_from_node[i].vector()).norm(), 1e-6);
  }
}

TEST(SparseOptimizerTest, PlacingCountsAsAStep) {
  PoseGraph graph = RandomLoopGraph(8, 80);
  for (std::size_t i = 1; i < graph.map_from_node.size(); ++i) {
    graph.map_from_node[i].x += 50.0 * Sin(static_cast<double>(i));
  }
  SparseOptions options;
  options.turn_first = true;
  PoseGraph one_step = graph;
  options.iterations_max = 1;
  EXPECT_EQ(OptimizeSparse(one_step, options).iterations, 1);
  PlaneProblem problem(graph, {});
  NormalEquations equations(problem.BlockSizes(), problem.Pairs());
  ASSERT_TRUE(problem.TurnToAgree(equations));
  ASSERT_TRUE(problem.PlaceToAgree(equations));
  EXPECT_EQ(one_step.map_from_node, graph.map_from_node);
}

TEST(SparseOptimizerTest, TurningFirstEndsInTheMinimumOfGaussNewton) {
  SparseOptions turn_first;
  turn_first.turn_first = true;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    PoseGraph graph = RandomLoopGraph(seed, 100);
    PoseGraph turned = graph;
    const double expected = OptimizeSparse(graph, {}).chi2_after;
    EXPECT_NEAR(OptimizeSparse(turned, turn_first).chi2_after, expected, 1e-9 * expected);
  }
}

// Measured turns that say nothing true, though hardly anything counts on them: headings that agree
// with them lead away from the minimum that the start is in.
TEST(SparseOptimizerTest, TurningFirstIsTakenBackWhereItLeadsHigher) {
  SparseOptions turn_first;
  turn_first.turn_first = true;
  int led_higher = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    RandomSequence random(seed);
    PoseGraph start = RandomLoopGraph(seed, 60);
    OptimizeSparse(start, {});
    for (GraphConstraint& constraint : start.constraints) {
      constraint.from_from_to.theta = random.NextUniform(-kPi, kPi);
      constraint.information(2, 2) = 1e-3;
    }
    OptimizeSparse(start, {});
    const double before = Chi2(start);
    PoseGraph unguarded = start;
    PlaneProblem problem(unguarded, {});
    NormalEquations equations(problem.BlockSizes(), problem.Pairs());
    ASSERT_TRUE(problem.TurnToAgree(equations));
    led_higher += Minimise(problem, LeastSquaresOptions{}).cost_after > 1.01 * before ? 1 : 0;
    PoseGraph guarded = start;
    EXPECT_LE(OptimizeSparse(guarded, turn_first).chi2_after, before);
  }
  EXPECT_GT(led_higher, 0);
}

TEST(SparseOptimizerTest, TurningFirstIsLeftOutWherePositionsAloneTieTheMap) {
  PoseGraph graph = RandomLoopGraph(3, 40);
  graph.fixed.clear();
  const Eigen::Matrix2d information = Eigen::Matrix2d::Identity();
  graph.position_priors = {{0, {0.0, 0.0}, information}, {39, {5.0, 5.0}, information}};
  {
    PlaneProblem problem(graph, {});
    NormalEquations equations(problem.BlockSizes(), problem.Pairs());
    EXPECT_FALSE(problem.TurnToAgree(equations));
  }
  graph.pose_priors = {{7, graph.map_from_node[7], Eigen::Matrix3d::Identity()}};
  PlaneProblem problem(graph, {});
  NormalEquations equations(problem.BlockSizes(), problem.Pairs());
  EXPECT_TRUE(problem.TurnToAgree(equations));
}

TEST(SparseOptimizerTest, TurningFirstIsLeftOutWherePointsSaySomethingAboutHeadings) {
  PoseGraph graph = RandomLoopGraph(2, 40);
  AddPoints(3, 5, graph);
  PoseGraph turned = graph;
  PlaneProblem problem(turned, {});
  NormalEquations equations(problem.BlockSizes(), problem.Pairs());
  EXPECT_FALSE(problem.TurnToAgree(equations));
  SparseOptions turn_first;
  turn_first.turn_first = true;
  OptimizeSparse(turned, turn_first);
  OptimizeSparse(graph, {});
  EXPECT_EQ(turned.map_from_node, graph.map_from_node);
}

TEST(SparseOptimizerTest, AKernelKeepsOneWrongClosureFromBendingTheMap) {
  PoseGraph clean = RandomLoopGraph(19, 80);
  PoseGraph wrong = clean;
  wrong.constraints.push_back(wrong.constraints.back());
  wrong.constraints.back().from_from_to = {8.0, 8.0, 1.0};
  PoseGraph trusting = wrong;
  OptimizeSparse(clean, SparseOptions{});
  OptimizeSparse(trusting, SparseOptions{});
  SparseOptions options;
  options.kernel = {RobustKernel::Shape::kCauchy, 3.0};
  EXPECT_TRUE(OptimizeSparse(wrong, options).converged);
  const auto worst_m = [&](const PoseGraph& graph) {
    double worst = 0.0;
    for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
      worst = std::max(
          worst,
          (graph.map_from_node[i].translation() - clean.map_from_node[i].translation()).norm());
    }
    return worst;
  };
  EXPECT_GT(worst_m(trusting), 1.0);
  EXPECT_LT(worst_m(wrong), 0.1);
}

TEST(SparseOptimizerTest, TakesGraphsThatAreHardlyGraphs) {
  PoseGraph empty;
  EXPECT_TRUE(OptimizeSparse(empty, SparseOptions{}).converged);
  PoseGraph one;
  one.map_from_node = {Pose2{1.0, 2.0, 3.0}};
  EXPECT_TRUE(OptimizeSparse(one, SparseOptions{}).converged);
  EXPECT_EQ(one.map_from_node[0], (Pose2{1.0, 2.0, 3.0}));
  PoseGraph apart = one;  // two nodes without a constraint: each holds itself
  apart.map_from_node.push_back(Pose2{});
  apart.points_in_map = {{3.0, 4.0}};  // and a point that nobody has seen
  EXPECT_TRUE(OptimizeSparse(apart, SparseOptions{}).converged);
  EXPECT_EQ(apart.points_in_map[0], Eigen::Vector2d(3.0, 4.0));
  PoseGraph zero = apart;  // joined by a constraint that says nothing
  zero.constraints.resize(1);
  zero.constraints[0].to = 1;
  zero.constraints[0].information.setZero();
  EXPECT_EQ(OptimizeSparse(zero, SparseOptions{}).cost_after, 0.0);
  EXPECT_TRUE(zero.map_from_node[1].vector().allFinite());
}

TEST(SparseOptimizerTest, DuplicateConstraintsCountTwiceAndHalfTurnsConverge) {
  PoseGraph graph;
  graph.map_from_node = {Pose2{}, Pose2{0.0, 0.0, 3.0}};
  GraphConstraint constraint;
  constraint.to = 1;
  constraint.from_from_to = {0.0, 0.0, kPi};
  graph.constraints = {constraint, constraint, constraint};
  graph.constraints[2].from_from_to = {0.0, 0.0, -kPi + 0.3};
  OptimizeSparse(graph, SparseOptions{});
  EXPECT_NEAR(WrapAngle(graph.map_from_node[1].theta - (kPi + 0.1)), 0.0, 1e-9);
}

TEST(GraphCovarianceTest, EqualsTheDenseInverse) {
  PoseGraph graph = RandomLoopGraph(21, 40);
  AddPoints(22, 5, graph);
  OptimizeSparse(graph, SparseOptions{});
  PlaneProblem problem(graph, RobustKernel{});
  // H from the numeric gradient of the errors is what the Jacobian tests check: dense from the same
  // linearisation is enough here.
  const Eigen::Index size = static_cast<Eigen::Index>(3 * 39 + 2 * graph.points_in_map.size());
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(size, size);
  const auto add =
      [&](const auto& linearised, const auto& information, Eigen::Index a, Eigen::Index b) {
        Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(linearised.error.size(), size);
        if (a >= 0) {
          jacobian.middleCols(a, linearised.jacobian_a.cols()) = linearised.jacobian_a;
        }
        jacobian.middleCols(b, linearised.jacobian_b.cols()) = linearised.jacobian_b;
        dense += jacobian.transpose() * information * jacobian;
      };
  const auto offset = [](std::uint32_t node) { return 3 * (static_cast<Eigen::Index>(node) - 1); };
  for (const GraphConstraint& c : graph.constraints) {
    add(Linearised(graph, c), c.information, offset(c.from), offset(c.to));
  }
  for (const PointConstraint& c : graph.point_constraints) {
    add(Linearised(graph, c), c.information, offset(c.from), 3 * 39 + 2 * Eigen::Index{c.point});
  }
  const Eigen::MatrixXd inverse = dense.inverse();
  StatusOr<GraphCovariance> covariance = GraphCovariance::Compute(graph, RobustKernel{});
  ASSERT_THAT(covariance, IsOk());
  EXPECT_EQ(covariance->Marginal(0), Eigen::Matrix3d::Zero());
  for (const std::uint32_t node : {1U, 17U, 39U}) {
    const Eigen::Matrix3d expected = inverse.block<3, 3>(offset(node), offset(node));
    EXPECT_LT((covariance->Marginal(node) - expected).norm(), 1e-9 * expected.norm());
  }
  for (const auto& [from, to] : {std::pair{3U, 30U}, {30U, 3U}, {5U, 3U}, {12U, 3U}}) {
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << -Adjoint(Inverse(graph.map_from_node[to]) * graph.map_from_node[from]),
        Eigen::Matrix3d::Identity();
    Eigen::Matrix<double, 6, 6> joint;
    joint << inverse.block<3, 3>(offset(from), offset(from)),
        inverse.block<3, 3>(offset(from), offset(to)),
        inverse.block<3, 3>(offset(to), offset(from)), inverse.block<3, 3>(offset(to), offset(to));
    const Eigen::Matrix3d expected = jacobian * joint * jacobian.transpose();
    EXPECT_LT((covariance->Relative(from, to) - expected).norm(), 1e-9 * joint.norm());
  }
  // Of a set, with the node that is held and one that is named twice.
  const std::vector<std::uint32_t> nodes{17, 0, 39, 3, 17};
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(15, 15);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (std::size_t j = 0; j < nodes.size(); ++j) {
      if (nodes[i] != 0 && nodes[j] != 0) {
        expected.block<3, 3>(3 * static_cast<Eigen::Index>(i), 3 * static_cast<Eigen::Index>(j)) =
            inverse.block<3, 3>(offset(nodes[i]), offset(nodes[j]));
      }
    }
  }
  const Eigen::MatrixXd joint = covariance->Joint(nodes);
  EXPECT_EQ(joint, joint.transpose());
  EXPECT_LT((joint - expected).norm(), 1e-9 * expected.norm());
}

TEST(GraphCovarianceTest, OfAChainCompoundsAndStaysWhenEverythingMoves) {
  PoseGraph graph;
  RandomSequence random(23);
  Covariance3 compounded = Covariance3::FromSigmas(0.1, 0.2, 0.03);
  graph.map_from_node = {RandomPose(random, 3.0, kPi)};
  for (std::uint32_t i = 1; i < 10; ++i) {
    const Pose2 step = RandomPose(random, 3.0, kPi);
    const Covariance3 step_covariance = Covariance3::FromSigmas(0.1, 0.2, 0.03);
    if (i > 1) {
      compounded = Compound(compounded, step, step_covariance);
    }
    graph.map_from_node.push_back(graph.map_from_node.back() * step);
    graph.constraints.push_back({i - 1, i, step, step_covariance.Information(), false});
  }
  for (const PoseGraph& each : {graph, Moved(Pose2{5.0, 6.0, 1.0}, graph)}) {
    StatusOr<GraphCovariance> covariance = GraphCovariance::Compute(each, RobustKernel{});
    ASSERT_THAT(covariance, IsOk());
    EXPECT_LT((covariance->Relative(0, 9) - compounded.matrix()).norm(), 1e-9);
    EXPECT_LT((covariance->Marginal(9) - compounded.matrix()).norm(), 1e-9);
  }
}

TEST(GraphCovarianceTest, RefusesANodeThatIsNotTiedInAllDirections) {
  PoseGraph graph;
  graph.map_from_node.resize(2);
  graph.constraints.resize(1);
  graph.constraints[0].to = 1;
  graph.constraints[0].information.diagonal() << 1.0, 0.0, 1.0;
  EXPECT_THAT(GraphCovariance::Compute(graph, RobustKernel{}),
              IsStatus(StatusCode::kFailedPrecondition));
}

}  // namespace
}  // namespace loci
