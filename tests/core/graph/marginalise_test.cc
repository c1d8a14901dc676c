// SPDX-License-Identifier: Apache-2.0
// Removed nodes: what they said of their neighbours stays, exactly or as nearly as a tree can.
#include "core/graph/marginalise.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "core/graph/joint_constraint.h"
#include "core/graph/normal_equations.h"
#include "core/graph/plane_problem.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_joint.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

// Near enough to the optimum that what is left of the gradient moves nothing by 1e-9.
PoseGraph AtOptimum(PoseGraph graph, const RobustKernel& kernel = {}) {
  SparseOptions options;
  options.kernel = kernel;
  options.relative_gain_min = 0.0;
  options.step_min = 1e-12;
  OptimizeSparse(graph, options);
  return graph;
}

// The poses of a graph after one step of Gauss-Newton.
std::vector<Pose2> AfterOneStep(PoseGraph graph, const RobustKernel& kernel = {}) {
  PlaneProblem problem(graph, kernel);
  NormalEquations equations(problem.BlockSizes(), problem.Pairs(), problem.Groups());
  equations.Clear();
  problem.Linearise(equations);
  EXPECT_TRUE(equations.Factor(/*damping=*/0.0));
  problem.Move(equations.Step(), equations);
  return graph.map_from_node;
}

double Difference(const Pose2& a, const Pose2& b) {
  return (Inverse(a) * b).vector().norm();
}

// Largest difference of poses, where the first ones also have `node`.
double DifferenceWithout(std::uint32_t node,
                         std::vector<Pose2> with,
                         const std::vector<Pose2>& without) {
  with.erase(with.begin() + static_cast<std::ptrdiff_t>(node));
  double largest = 0.0;
  for (std::size_t i = 0; i < with.size(); ++i) {
    largest = std::max(largest, Difference(with[i], without[i]));
  }
  return largest;
}

// A node in the middle of `count` others, which see it; all of them know the one before.
PoseGraph Wheel(std::uint64_t seed, std::uint32_t count) {
  RandomSequence random(seed);
  PoseGraph graph;
  for (std::uint32_t i = 0; i <= count; ++i) {
    graph.map_from_node.push_back(RandomPose(random, 10.0, kPi));
  }
  const auto add = [&](std::uint32_t from, std::uint32_t to) {
    graph.constraints.push_back(
        {from,
         to,
         Inverse(graph.map_from_node[from]) * graph.map_from_node[to] * Noise(random, 0.05, 0.02),
         (20.0 * RandomInformation(random)).eval(),
         false});
  };
  for (std::uint32_t i = 1; i <= count; ++i) {
    i % 2 == 0 ? add(0, i) : add(i, 0);
    if (i > 1) {
      add(i - 1, i);
    }
  }
  return graph;
}

MarginalOptions DenseUpTo(std::size_t neighbours) {
  MarginalOptions options;
  options.dense_neighbours_max = neighbours;
  return options;
}

TEST(MarginaliseTest, ExactlyTheOtherNodesTakeTheSameStepFromAnyPoses) {
  for (std::uint32_t count = 2; count <= 7; ++count) {
    SCOPED_TRACE(count);
    PoseGraph graph = Wheel(400 + count, count);
    graph.fixed.resize(2);
    graph.fixed[1] = true;  // a neighbour that keeps its pose
    const std::vector<Pose2> expected = AfterOneStep(graph);
    ASSERT_THAT(MarginaliseNode(0, DenseUpTo(7), graph), IsOk());
    EXPECT_THAT(ValidateGraph(graph), IsOk());
    EXPECT_EQ(graph.joint_constraints.size(), count == 2 ? 0U : 1U);
    EXPECT_EQ(graph.constraints.size(), count - 1 + (count == 2 ? 1U : 0U));
    EXPECT_TRUE(graph.IsFixed(0)) << "numbers have moved down by one";
    EXPECT_LT(DifferenceWithout(0, expected, AfterOneStep(graph)), 1e-9);
  }
}

TEST(MarginaliseTest, ExactlyTheOtherNodesKeepTheirOptimumAndTheirCovariances) {
  for (const std::uint64_t seed : {421U, 422U, 423U}) {
    SCOPED_TRACE(seed);
    PoseGraph graph = AtOptimum(RandomLoopGraph(seed, 60));
    StatusOr<GraphCovariance> before = GraphCovariance::Compute(graph, RobustKernel{});
    ASSERT_THAT(before, IsOk());
    std::vector<std::uint32_t> number(60);  // before the removals, per node
    for (std::uint32_t i = 0; i < 60; ++i) {
      number[i] = i;
    }
    // Not neighbours of each other: every one has four neighbours at most.
    for (const std::uint32_t node : {57U, 41U, 23U, 12U, 5U}) {
      const std::vector<Pose2> poses = graph.map_from_node;
      ASSERT_THAT(MarginaliseNode(node, MarginalOptions{}, graph), IsOk());
      number.erase(number.begin() + node);
      EXPECT_LT(DifferenceWithout(node, poses, AtOptimum(graph).map_from_node), 1e-8);
    }
    EXPECT_EQ(graph.joint_constraints.size(), 5U);
    StatusOr<GraphCovariance> after = GraphCovariance::Compute(graph, RobustKernel{});
    ASSERT_THAT(after, IsOk());
    for (std::uint32_t node = 1; node < graph.map_from_node.size(); ++node) {
      const Eigen::Matrix3d expected = before->Marginal(number[node]);
      EXPECT_LT((after->Marginal(node) - expected).norm(), 1e-9 * expected.norm()) << node;
    }
  }
}

TEST(MarginaliseTest, AChainComesDownToTheCompoundedConstraintOfItsEnds) {
  PoseGraph graph = RandomLoopGraph(431, 15);
  StatusOr<GraphCovariance> before = GraphCovariance::Compute(graph, RobustKernel{});
  ASSERT_THAT(before, IsOk());
  const Eigen::Matrix3d covariance = before->Relative(0, 14);
  const Pose2 first_from_last = Inverse(graph.map_from_node[0]) * graph.map_from_node[14];
  while (graph.map_from_node.size() > 2) {
    ASSERT_THAT(MarginaliseNode(1, MarginalOptions{}, graph), IsOk());
  }
  ASSERT_EQ(graph.constraints.size(), 1U);
  EXPECT_LT(Difference(graph.constraints[0].from_from_to, first_from_last), 1e-9);
  EXPECT_LT((graph.constraints[0].information.inverse() - covariance).norm(),
            1e-9 * covariance.norm());
}

TEST(MarginaliseTest, ANodeWithOneNeighbourOrNoneLeavesNothing) {
  PoseGraph graph = RandomLoopGraph(432, 10);
  graph.constraints.push_back(graph.constraints.back());  // twice to the same neighbour
  graph.constraints.back().from_from_to.x += 0.5;
  const std::vector<Pose2> poses = graph.map_from_node;
  ASSERT_THAT(MarginaliseNode(9, MarginalOptions{}, graph), IsOk());
  EXPECT_EQ(graph.map_from_node.size(), 9U);
  EXPECT_EQ(graph.constraints.size(), 8U);
  EXPECT_LT(DifferenceWithout(9, poses, graph.map_from_node), 1e-12);
  PoseGraph alone;
  alone.map_from_node.resize(1);
  ASSERT_THAT(MarginaliseNode(0, MarginalOptions{}, alone), IsOk());
  EXPECT_TRUE(alone.map_from_node.empty());
}

TEST(MarginaliseTest, TheHeldNodeMayGoAndRelativePosesStay) {
  PoseGraph graph = RandomLoopGraph(433, 50);
  graph.fixed.clear();
  graph = AtOptimum(graph);
  StatusOr<GraphCovariance> before = GraphCovariance::Compute(graph, RobustKernel{});
  ASSERT_THAT(before, IsOk());
  const std::vector<Pose2> poses = graph.map_from_node;
  ASSERT_THAT(MarginaliseNode(0, MarginalOptions{}, graph), IsOk());
  EXPECT_LT(DifferenceWithout(0, poses, AtOptimum(graph).map_from_node), 1e-8);
  StatusOr<GraphCovariance> after = GraphCovariance::Compute(graph, RobustKernel{});
  ASSERT_THAT(after, IsOk());
  const Eigen::Matrix3d expected = before->Relative(7, 31);
  EXPECT_LT((after->Relative(6, 30) - expected).norm(), 1e-8 * expected.norm());
}

TEST(MarginaliseTest, JointConstraintsAreTakenInAgain) {
  PoseGraph graph = Wheel(434, 3);
  graph.fixed.resize(4);
  graph.fixed[3] = true;
  RandomSequence random(435);
  // One in which the node comes first, one in which it comes later, and one without it.
  graph.joint_constraints = {RandomJoint({0, 2, 3}, graph, 0.1, 0.1, random),
                             RandomJoint({3, 1, 0}, graph, 0.1, 0.1, random),
                             RandomJoint({1, 2, 3}, graph, 0.1, 0.1, random)};
  const std::vector<Pose2> expected = AfterOneStep(graph);
  ASSERT_THAT(MarginaliseNode(0, MarginalOptions{}, graph), IsOk());
  EXPECT_EQ(graph.joint_constraints.size(), 2U);
  EXPECT_LT(DifferenceWithout(0, expected, AfterOneStep(graph)), 1e-9);
}

TEST(MarginaliseTest, ARobustConstraintCountsWithItsWeightAtThePresentPoses) {
  PoseGraph graph = Wheel(436, 3);
  graph.fixed = {false, true};
  MarginalOptions options;
  options.kernel = {RobustKernel::Shape::kCauchy, 1.0};
  graph.constraints[0].robust = true;
  graph.constraints[0].from_from_to.x += 0.4;
  ASSERT_GT(Chi2Of(graph, graph.constraints[0]), 2.0);
  const std::vector<Pose2> expected = AfterOneStep(graph, options.kernel);
  EXPECT_GT(Difference(AfterOneStep(graph)[2], expected[2]), 1e-4);
  ASSERT_THAT(MarginaliseNode(0, options, graph), IsOk());
  EXPECT_LT(DifferenceWithout(0, expected, AfterOneStep(graph, options.kernel)), 1e-9);
}

TEST(MarginaliseTest, APartialInformationStaysPartial) {
  // 1 knows 0 in all directions, 0 knows 2 in one only; 1 knows 2 by itself.
  PoseGraph graph = Wheel(437, 2);
  graph.fixed = {false, true};
  GraphConstraint& partial = graph.constraints[1];
  ASSERT_EQ(partial.to, 2U);
  const Eigen::Vector3d known(1.0, 2.0, -0.5);
  partial.information = 10.0 * known * known.transpose();
  const std::vector<Pose2> expected = AfterOneStep(graph);
  ASSERT_THAT(MarginaliseNode(0, MarginalOptions{}, graph), IsOk());
  EXPECT_THAT(ValidateGraph(graph), IsOk());
  const Eigen::Vector3d eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(graph.constraints.back().information)
          .eigenvalues();
  EXPECT_LT(std::abs(eigenvalues(1)), 1e-9 * eigenvalues(2));
  EXPECT_GT(eigenvalues(2), 1.0);
  EXPECT_LT(DifferenceWithout(0, expected, AfterOneStep(graph)), 1e-8);
}

TEST(MarginaliseTest, InformationOfZeroLeavesZeroAndTheComponentWhole) {
  for (const bool both : {false, true}) {
    PoseGraph graph = Wheel(438, 2);
    graph.constraints.resize(2);
    graph.constraints[0].information.setZero();
    if (both) {
      graph.constraints[1].information.setZero();
    }
    ASSERT_THAT(MarginaliseNode(0, MarginalOptions{}, graph), IsOk());
    ASSERT_EQ(graph.constraints.size(), 1U);
    EXPECT_EQ(graph.constraints[0].information, Eigen::Matrix3d::Zero());
    EXPECT_EQ(CountZeroInformation(graph), 1U);
    EXPECT_EQ(FindComponents(graph).count, 1U);
  }
}

TEST(MarginaliseTest, AWeakConstraintBesideAStiffOneCountsWhicheverNodeComesFirst) {
  for (const bool weak_first : {false, true}) {
    SCOPED_TRACE(weak_first);
    PoseGraph graph;
    graph.map_from_node = {Pose2{}, Pose2{0.2, 0.0, 0.5}, Pose2{0.0, 0.1, -0.5}};
    for (const std::uint32_t node : {1U, 2U}) {
      const double information = (node == 1) == weak_first ? 1e-3 : 1e10;
      graph.constraints.push_back(
          {0, node, graph.map_from_node[node], information * Eigen::Matrix3d::Identity(), false});
    }
    // The node moves with the stiff neighbour: what the weak constraint says of it is said of that.
    const Pose2 first_from_second = Inverse(graph.map_from_node[1]) * graph.map_from_node[2];
    const Eigen::Matrix3d seen =
        weak_first ? Adjoint(first_from_second) : Eigen::Matrix3d::Identity().eval();
    const Eigen::Matrix3d expected = 1e-3 * seen.transpose() * seen;
    ASSERT_THAT(MarginaliseNode(0, MarginalOptions{}, graph), IsOk());
    ASSERT_EQ(graph.constraints.size(), 1U);
    EXPECT_LT(Difference(graph.constraints[0].from_from_to, first_from_second), 1e-9);
    EXPECT_LT((graph.constraints[0].information - expected).norm(), 0.05 * expected.norm())
        << graph.constraints[0].information;
  }
}

TEST(MarginaliseTest, ASumOfConstraintsTakesTheSameStep) {
  PoseGraph graph = Wheel(439, 4);
  RandomSequence random(440);
  graph.joint_constraints = {RandomJoint({4, 2, 3}, graph, 0.1, 0.1, random),
                             RandomJoint({2, 3}, graph, 0.1, 0.1, random),
                             RandomJoint({3, 4}, graph, 0.1, 0.1, random)};
  const std::vector<Pose2> expected = AfterOneStep(graph);
  const StatusOr<JointConstraint> sum = SumOf(graph, graph.joint_constraints);
  ASSERT_THAT(sum, IsOk());
  EXPECT_EQ(sum->nodes, (std::vector<std::uint32_t>{2, 3, 4}));
  graph.joint_constraints = {*sum};
  EXPECT_THAT(ValidateGraph(graph), IsOk());
  const std::vector<Pose2> after = AfterOneStep(graph);
  for (std::size_t node = 0; node < expected.size(); ++node) {
    EXPECT_LT(Difference(expected[node], after[node]), 1e-9);
  }
}

// H of some constraints, for the poses of all nodes but node 0.
Eigen::MatrixXd InformationOf(const PoseGraph& graph, const NodeMarginal& marginal) {
  const auto size = 3 * static_cast<Eigen::Index>(graph.map_from_node.size());
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(size, size);
  const auto add = [&](const JointConstraint& constraint) {
    const LinearisedJoint linearised = Linearised(graph, constraint);
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(linearised.error.size(), size);
    for (std::size_t i = 0; i < constraint.nodes.size(); ++i) {
      jacobian.middleCols<3>(3 * static_cast<Eigen::Index>(constraint.nodes[i])) =
          linearised.jacobian.middleCols<3>(3 * static_cast<Eigen::Index>(i));
    }
    h += jacobian.transpose() * constraint.information * jacobian;
  };
  for (const GraphConstraint& pair : marginal.constraints) {
    add({{pair.from, pair.to}, {pair.from_from_to}, pair.information});
  }
  std::for_each(marginal.joint_constraints.begin(), marginal.joint_constraints.end(), add);
  return h;
}

// Of the normal distribution with `covariance` from that with `information`, both of mean 0.
double Divergence(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& information) {
  const Eigen::MatrixXd product = information * covariance;
  return 0.5 *
         (product.trace() - static_cast<double>(product.rows()) - std::log(product.determinant()));
}

// The edges of the tree that a Pruefer sequence names, over nodes 0, 1 ..
std::vector<std::pair<std::uint32_t, std::uint32_t>> TreeOf(
    const std::vector<std::uint32_t>& sequence) {
  const std::size_t count = sequence.size() + 2;
  std::vector<int> degree(count, 1);
  for (const std::uint32_t node : sequence) {
    ++degree[node];
  }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  const auto take_leaf = [&] {
    const auto leaf = std::find(degree.begin(), degree.end(), 1);
    *leaf = 0;
    return static_cast<std::uint32_t>(leaf - degree.begin());
  };
  for (const std::uint32_t node : sequence) {
    edges.emplace_back(take_leaf(), node);
    --degree[node];
  }
  const std::uint32_t last = take_leaf();
  edges.emplace_back(last, take_leaf());
  return edges;
}

TEST(MarginaliseTest, TheTreeHasTheLeastDivergenceOfAllTrees) {
  constexpr std::uint32_t kNeighbours = 5;
  for (const std::uint64_t seed : {441U, 442U, 443U, 444U}) {
    SCOPED_TRACE(seed);
    PoseGraph graph = Wheel(seed, kNeighbours);
    const StatusOr<NodeMarginal> exact = MarginalOf(graph, 0, DenseUpTo(kNeighbours));
    const StatusOr<NodeMarginal> tree = MarginalOf(graph, 0, DenseUpTo(2));
    ASSERT_THAT(exact, IsOk());
    ASSERT_THAT(tree, IsOk());
    EXPECT_TRUE(tree->joint_constraints.empty());
    ASSERT_EQ(tree->constraints.size(), kNeighbours - 1);
    // Relative to node 1, which then has covariance 0.
    constexpr Eigen::Index kSize = 3 * (kNeighbours - 1);
    const Eigen::MatrixXd exact_information =
        InformationOf(graph, *exact).bottomRightCorner<kSize, kSize>();
    const Eigen::MatrixXd covariance = exact_information.inverse();
    const double divergence =
        Divergence(covariance, InformationOf(graph, *tree).bottomRightCorner<kSize, kSize>());
    EXPECT_GT(divergence, 0.0);

    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(kSize + 3, kSize + 3);
    all.bottomRightCorner<kSize, kSize>() = covariance;
    std::size_t no_better = 0;
    std::vector<std::uint32_t> sequence(kNeighbours - 2);
    for (std::uint32_t code = 0; code < 125; ++code) {  // 5^3 trees
      sequence = {code % 5, code / 5 % 5, code / 25};
      NodeMarginal other;
      for (const auto& [from, to] : TreeOf(sequence)) {
        // The relative covariance, by the whole joint one.
        Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3, kSize + 3);
        const Pose2 to_from_from =
            Inverse(graph.map_from_node[to + 1]) * graph.map_from_node[from + 1];
        jacobian.middleCols<3>(3 * from) = -Adjoint(to_from_from);
        jacobian.middleCols<3>(3 * to).setIdentity();
        GraphConstraint pair;
        pair.from = from + 1;
        pair.to = to + 1;
        pair.from_from_to = Inverse(to_from_from);
        pair.information = (jacobian * all * jacobian.transpose()).inverse();
        other.constraints.push_back(pair);
      }
      const double other_divergence =
          Divergence(covariance, InformationOf(graph, other).bottomRightCorner<kSize, kSize>());
      no_better += other_divergence >= divergence - 1e-9 ? 1U : 0U;
    }
    EXPECT_EQ(no_better, 125U);
  }
}

TEST(MarginaliseTest, ATreeKeepsTheOptimumAndIsPositiveDefinite) {
  for (const std::uint64_t seed : {451U, 452U, 453U}) {
    SCOPED_TRACE(seed);
    PoseGraph graph = AtOptimum(Wheel(seed, 9));
    const std::vector<Pose2> poses = graph.map_from_node;
    const std::size_t others = graph.constraints.size() - 9;
    ASSERT_THAT(MarginaliseNode(0, MarginalOptions{}, graph), IsOk());
    EXPECT_EQ(graph.constraints.size(), others + 8);
    for (std::size_t i = others; i < graph.constraints.size(); ++i) {
      const Eigen::Matrix3d& information = graph.constraints[i].information;
      EXPECT_EQ(information, information.transpose());
      EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information).eigenvalues()(0), 0.0);
    }
    EXPECT_LT(DifferenceWithout(0, poses, AtOptimum(graph).map_from_node), 1e-7);
  }
}

TEST(MarginaliseTest, AGraphCanBeTakenDownNodeByNode) {
  PoseGraph graph = AtOptimum(RandomLoopGraph(461, 80));
  RandomSequence random(462);
  StatusOr<GraphCovariance> whole = GraphCovariance::Compute(graph, RobustKernel{});
  ASSERT_THAT(whole, IsOk());
  const double sigma_m = std::sqrt(whole->Marginal(79).topLeftCorner<2, 2>().trace());
  const Pose2 last = graph.map_from_node.back();
  while (graph.map_from_node.size() > 5) {
    const auto node =
        static_cast<std::uint32_t>(1 + random.NextBits() % (graph.map_from_node.size() - 2));
    ASSERT_THAT(MarginaliseNode(node, MarginalOptions{}, graph), IsOk());
    ASSERT_THAT(ValidateGraph(graph), IsOk());
  }
  for (const JointConstraint& joint : graph.joint_constraints) {
    EXPECT_LE(joint.nodes.size(), 4U);
  }
  EXPECT_LT(Difference(AtOptimum(graph).map_from_node.back(), last), 1e-6);
  StatusOr<GraphCovariance> left = GraphCovariance::Compute(graph, RobustKernel{});
  ASSERT_THAT(left, IsOk());
  const double left_sigma_m = std::sqrt(left->Marginal(4).topLeftCorner<2, 2>().trace());
  EXPECT_GT(left_sigma_m, 0.3 * sigma_m);
  EXPECT_LT(left_sigma_m, 3.0 * sigma_m);
}

TEST(MarginaliseTest, OtherNodesPriorsAndPointsFollowTheirNodes) {
  PoseGraph graph = RandomLoopGraph(463, 20);
  graph.points_in_map = {{1.0, 2.0}};
  graph.point_constraints.resize(2);
  graph.point_constraints[0].from = 3;
  graph.point_constraints[1].from = 12;
  graph.pose_priors.push_back({.node = 11});
  graph.position_priors.push_back({.node = 1});
  graph.fixed.assign(15, false);
  graph.fixed[14] = true;
  ASSERT_THAT(MarginaliseNode(10, MarginalOptions{}, graph), IsOk());
  EXPECT_EQ(graph.point_constraints[0].from, 3U);
  EXPECT_EQ(graph.point_constraints[1].from, 11U);
  EXPECT_EQ(graph.pose_priors[0].node, 10U);
  EXPECT_EQ(graph.position_priors[0].node, 1U);
  EXPECT_EQ(std::count(graph.fixed.begin(), graph.fixed.end(), true), 1);
  EXPECT_TRUE(graph.IsFixed(13));
}

TEST(MarginaliseTest, WhatCannotGoIsRefusedByNameAndTheGraphStays) {
  const PoseGraph whole = Wheel(464, 6);
  const auto refuses = [&](StatusCode code, const char* what, const auto& change) {
    PoseGraph graph = whole;
    change(graph);
    const PoseGraph before = graph;
    EXPECT_THAT(MarginaliseNode(0, MarginalOptions{}, graph), IsStatus(code, what));
    EXPECT_EQ(graph.map_from_node, before.map_from_node);
    EXPECT_EQ(graph.constraints.size(), before.constraints.size());
  };
  constexpr StatusCode kPrecondition = StatusCode::kFailedPrecondition;
  refuses(kPrecondition, "node 0: is fixed", [](PoseGraph& g) { g.fixed = {true}; });
  refuses(kPrecondition, "node 0: has pose_priors[1]", [](PoseGraph& g) {
    g.pose_priors.resize(2);
    g.pose_priors[0].node = 3;
  });
  refuses(kPrecondition, "node 0: has position_priors[0]", [](PoseGraph& g) {
    g.position_priors.resize(1);
  });
  refuses(kPrecondition, "node 0: has point_constraints[0]", [](PoseGraph& g) {
    g.points_in_map.resize(1);
    g.point_constraints.resize(1);
  });
  refuses(StatusCode::kInvalidArgument, "node 0: constraints[4] joins it", [](PoseGraph& g) {
    g.constraints[4].from = 0;
    g.constraints[4].to = 0;
  });
  refuses(StatusCode::kInvalidArgument, "node 0: must be < 0", [](PoseGraph& g) {
    g.map_from_node.clear();
    g.constraints.clear();
  });
  refuses(kPrecondition, "node 0: its constraints determine 12 of 15", [](PoseGraph& g) {
    for (GraphConstraint& constraint : g.constraints) {
      if (constraint.from == 4 || constraint.to == 4) {
        constraint.information.setZero();
      }
    }
  });
  refuses(kPrecondition, "node 0: constraints disagree about", [](PoseGraph& g) {
    g.constraints.resize(2);
    // By four radians along the way from one neighbour to the other.
    for (GraphConstraint& constraint : g.constraints) {
      constraint.information = Eigen::Vector3d(1.0, 1.0, 1.0).asDiagonal();
      constraint.from_from_to.theta = WrapAngle(constraint.from_from_to.theta + 2.0);
    }
  });
}

}  // namespace
}  // namespace loci
