// SPDX-License-Identifier: Apache-2.0
// The incremental optimiser while nodes are marginalised, against the batch one.
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/graph/incremental_optimizer.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/exact_options.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_joint.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

// And nothing is too young to go.
IncrementalOptions WithoutWindow() {
  IncrementalOptions options = ExactOptions();
  options.retract_window = 0;
  return options;
}

PoseGraph AtOptimum(PoseGraph graph) {
  SparseOptions options;
  options.relative_gain_min = 0.0;
  options.step_min = 1e-12;
  OptimizeSparse(graph, options);
  return graph;
}

void ExpectBatchOptimum(const IncrementalOptimizer& optimizer) {
  const PoseGraph graph = optimizer.Graph();
  EXPECT_THAT(ValidateGraph(graph), IsOk());
  const double chi2 = Chi2(AtOptimum(graph));
  EXPECT_NEAR(Chi2(graph), chi2, 1e-6 * chi2);
}

double Difference(const Pose2& a, const Pose2& b) {
  return (Inverse(a) * b).vector().norm();
}

// Adds a node of a graph, with its constraints to those before. Returns the number of the last
// constraint.
std::uint32_t AddNodeOf(const PoseGraph& whole,
                        std::uint32_t node,
                        IncrementalOptimizer& optimizer) {
  optimizer.AddNode(whole.map_from_node[node], whole.IsFixed(node));
  std::uint32_t last = 0;
  for (const GraphConstraint& constraint : whole.constraints) {
    if (std::max(constraint.from, constraint.to) == node) {
      last = optimizer.AddConstraint(constraint);
    }
  }
  return last;
}

void AddAllOf(const PoseGraph& whole, IncrementalOptimizer& optimizer) {
  for (std::uint32_t node = 0; node < whole.map_from_node.size(); ++node) {
    AddNodeOf(whole, node, optimizer);
  }
  EXPECT_TRUE(optimizer.Update().converged);
}

TEST(IncrementalMarginalsTest, TheOthersStayAtTheOptimumAsInABatch) {
  IncrementalOptimizer optimizer(WithoutWindow());
  const PoseGraph whole = RandomLoopGraph(501, 80);
  AddAllOf(whole, optimizer);
  const std::vector<Pose2> before = optimizer.Graph().map_from_node;
  PoseGraph batch = AtOptimum(whole);
  // From above, so that the batch's numbers of those still to go stay. Neighbours are among them.
  const std::vector<std::uint32_t> going{70, 69, 55, 49, 48, 47, 28, 8, 7};
  for (const std::uint32_t node : going) {
    ASSERT_THAT(optimizer.MarginaliseNode(node), IsOk());
    ASSERT_THAT(MarginaliseNode(node, MarginalOptions{}, batch), IsOk());
  }
  ASSERT_TRUE(optimizer.Update().converged);
  ExpectBatchOptimum(optimizer);
  batch = AtOptimum(batch);
  std::size_t in_batch = 0;
  for (std::uint32_t node = 0; node < 80; ++node) {
    EXPECT_LT(Difference(optimizer.map_from_node(node), before[node]), 1e-6) << node;
    if (std::find(going.begin(), going.end(), node) == going.end()) {
      EXPECT_LT(Difference(optimizer.map_from_node(node), batch.map_from_node[in_batch++]), 1e-6);
    }
  }
}

TEST(IncrementalMarginalsTest, WhatComesLaterMovesTheRestAsIfTheNodesWereThere) {
  const PoseGraph whole = RandomLoopGraph(502, 80);
  IncrementalOptimizer with(WithoutWindow());
  IncrementalOptimizer without(WithoutWindow());
  AddAllOf(whole, with);
  AddAllOf(whole, without);
  for (const std::uint32_t node : {61U, 44U, 33U, 10U}) {
    ASSERT_THAT(without.MarginaliseNode(node), IsOk());
  }
  const GraphConstraint closure{
      3,
      78,
      Inverse(with.map_from_node(3)) * with.map_from_node(78) * Pose2{0.05, 0.02, 0.005},
      500.0 * Eigen::Matrix3d::Identity(),
      false};
  const Pose2 before = with.map_from_node(70);
  for (IncrementalOptimizer* each : {&with, &without}) {
    each->AddConstraint(closure);
    ASSERT_TRUE(each->Update().converged);
  }
  const double moved = Difference(before, with.map_from_node(70));
  EXPECT_GT(moved, 1e-3);
  EXPECT_LT(Difference(without.map_from_node(70), with.map_from_node(70)), 0.02 * moved);
}

TEST(IncrementalMarginalsTest, AfterAnyAdditionsRetractionsAndMarginalsItIsAtTheBatchOptimum) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE(seed);
    RandomSequence random(seed);
    PoseGraph whole = RandomLoopGraph(510 + seed, 150);
    if (seed % 2 == 0) {
      whole.fixed.clear();  // the lowest node is held, and goes too
    }
    IncrementalOptimizer optimizer(WithoutWindow());
    std::vector<std::uint32_t> loops;
    std::vector<bool> gone(150);
    std::size_t marginalised = 0;
    std::size_t retracted = 0;
    for (std::uint32_t node = 0; node < 150; ++node) {
      const std::uint32_t last = AddNodeOf(whole, node, optimizer);
      if (node >= 20) {
        loops.push_back(last);
      }
      if (loops.size() > 3 && random.NextBits() % 4 == 0) {
        const std::size_t which = random.NextBits() % loops.size();
        const Status status = optimizer.RemoveConstraint(loops[which]);
        EXPECT_TRUE(status.ok() || status.code() == StatusCode::kFailedPrecondition);
        retracted += status.ok() ? 1U : 0U;
        loops.erase(loops.begin() + static_cast<std::ptrdiff_t>(which));
      }
      if (random.NextBits() % 3 == 0) {
        ASSERT_TRUE(optimizer.Update().converged);
      }
      // Not those that the loops of nodes to come will name.
      if (node > 45 && random.NextBits() % 2 == 0) {
        const auto going = static_cast<std::uint32_t>(random.NextBits() % (node - 24));
        const Status status = optimizer.MarginaliseNode(going);
        if (gone[going]) {
          EXPECT_THAT(status, IsStatus(StatusCode::kNotFound, "is not there"));
        } else if (whole.IsFixed(going)) {
          EXPECT_THAT(status, IsStatus(StatusCode::kFailedPrecondition, "is fixed"));
        } else {
          EXPECT_THAT(status, IsOk());
          gone[going] = true;
          ++marginalised;
        }
      }
      if (node % 25 == 24) {
        ASSERT_TRUE(optimizer.Update().converged);
        ExpectBatchOptimum(optimizer);
      }
    }
    EXPECT_GT(marginalised, 20U);
    EXPECT_GT(retracted, 5U);
  }
}

TEST(IncrementalMarginalsTest, ARemovedConstraintLeavesTheGraphThatNeverHadIt) {
  IncrementalOptimizer never(WithoutWindow());
  IncrementalOptimizer once(WithoutWindow());
  for (IncrementalOptimizer* each : {&never, &once}) {
    AddAllOf(RandomLoopGraph(525, 100), *each);
    for (const std::uint32_t node : {6U, 27U, 28U, 80U}) {
      ASSERT_THAT(each->MarginaliseNode(node), IsOk());
    }
  }
  const double chi2 = Chi2(once.Graph());
  const std::uint32_t index = once.AddConstraint(
      GraphConstraint{5, 77, {3.0, 1.0, 2.0}, 100.0 * Eigen::Matrix3d::Identity(), false});
  ASSERT_TRUE(once.Update().determined);
  EXPECT_GT(Chi2(once.Graph()), 2.0 * chi2);
  ASSERT_THAT(once.RemoveConstraint(index), IsOk());
  ASSERT_TRUE(once.Update().converged);
  ASSERT_TRUE(never.Update().converged);
  EXPECT_NEAR(Chi2(once.Graph()), Chi2(never.Graph()), 1e-6 * Chi2(never.Graph()));
}

TEST(IncrementalMarginalsTest, TheHeldNodeMayGoAndTheNextOneIsHeld) {
  PoseGraph whole = RandomLoopGraph(526, 50);
  whole.fixed.clear();
  IncrementalOptimizer optimizer(WithoutWindow());
  AddAllOf(whole, optimizer);
  for (const std::uint32_t node : {0U, 1U, 3U, 2U}) {
    const std::vector<Pose2> before = optimizer.Graph().map_from_node;
    ASSERT_THAT(optimizer.MarginaliseNode(node), IsOk());
    ASSERT_TRUE(optimizer.Update().converged);
    for (std::uint32_t other = 0; other < 50; ++other) {
      EXPECT_LT(Difference(optimizer.map_from_node(other), before[other]), 1e-6);
    }
  }
  const Pose2 held = optimizer.map_from_node(4);
  optimizer.AddConstraint(
      GraphConstraint{4, 49, {1.0, 2.0, 0.5}, 100.0 * Eigen::Matrix3d::Identity(), false});
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_EQ(optimizer.map_from_node(4), held);
  ExpectBatchOptimum(optimizer);
}

TEST(IncrementalMarginalsTest, ALastNodeAndALonelyOneMayGo) {
  IncrementalOptimizer optimizer(WithoutWindow());
  const Eigen::Matrix3d information = 100.0 * Eigen::Matrix3d::Identity();
  optimizer.AddNode({}, false);
  optimizer.AddNode({1.0, 0.0, 0.0}, false);
  optimizer.AddConstraint(GraphConstraint{0, 1, {1.0, 0.0, 0.0}, information, false});
  optimizer.AddNode({7.0, 0.0, 0.0}, false);
  ASSERT_TRUE(optimizer.Update().converged);
  ASSERT_THAT(optimizer.MarginaliseNode(2), IsOk()) << "has no constraint";
  ASSERT_THAT(optimizer.MarginaliseNode(0), IsOk()) << "is held; the other one is, now";
  ASSERT_TRUE(optimizer.Update().converged);
  ASSERT_THAT(optimizer.MarginaliseNode(1), IsOk());
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_TRUE(optimizer.Graph().constraints.empty());
  // And it goes on.
  EXPECT_EQ(optimizer.AddNode({}, false), 3U);
  EXPECT_EQ(optimizer.AddNode({}, false), 4U);
  EXPECT_EQ(optimizer.AddConstraint(GraphConstraint{3, 4, {2.0, 0.0, 0.0}, information, false}),
            1U);
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_NEAR(optimizer.map_from_node(4).x, 2.0, 1e-9);
}

TEST(IncrementalMarginalsTest, WhatANodeLeavesKeepsItsNeighboursTogether) {
  // 0 - 1 - 2 - 3, and 1 goes; then the constraint of 2 and 3 does.
  IncrementalOptimizer optimizer(WithoutWindow());
  const Eigen::Matrix3d information = 100.0 * Eigen::Matrix3d::Identity();
  std::uint32_t last = 0;
  for (std::uint32_t node = 0; node < 4; ++node) {
    optimizer.AddNode({1.0 * node, 0.0, 0.0}, false);
    if (node > 0) {
      last = optimizer.AddConstraint(
          GraphConstraint{node - 1, node, {1.0, 0.0, 0.0}, information, false});
    }
  }
  ASSERT_TRUE(optimizer.Update().converged);
  ASSERT_THAT(optimizer.MarginaliseNode(1), IsOk());
  ASSERT_THAT(optimizer.RemoveConstraint(last), IsOk());
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_EQ(HeldNodes(optimizer.Graph()), (std::vector<bool>{true, true, false, true}));
  EXPECT_NEAR(optimizer.map_from_node(2).x, 2.0, 1e-9);
}

TEST(IncrementalMarginalsTest, WhatMayBeTakenBackProtectsItsNodes) {
  IncrementalOptions options = WithoutWindow();
  options.retract_window = 30;
  IncrementalOptimizer optimizer(options);
  const PoseGraph whole = RandomLoopGraph(527, 60);
  for (std::uint32_t node = 0; node < 40; ++node) {
    AddNodeOf(whole, node, optimizer);
  }
  ASSERT_TRUE(optimizer.Update().converged);
  // 59 constraints. The last one of node 4 is that with node 24, number 23 + 5, at place 28.
  EXPECT_THAT(
      optimizer.MarginaliseNode(39),
      IsStatus(StatusCode::kFailedPrecondition, "node 39: constraint 57 may still be taken"));
  const std::uint32_t loop = 28;
  ASSERT_EQ(optimizer.Graph().constraints[loop].from, 4U);
  ASSERT_EQ(optimizer.Graph().constraints.size() - 1 - loop, 30U);
  EXPECT_THAT(optimizer.MarginaliseNode(5),
              IsStatus(StatusCode::kFailedPrecondition,
                       "constraint 30 may still be taken back, since only 28"));
  EXPECT_THAT(optimizer.MarginaliseNode(4), IsOk());
  EXPECT_THAT(optimizer.RemoveConstraint(loop),
              IsStatus(StatusCode::kFailedPrecondition, "constraint 28: node 4 has been"));
  AddNodeOf(whole, 40, optimizer);
  EXPECT_THAT(optimizer.MarginaliseNode(5), IsOk());
}

TEST(IncrementalMarginalsTest, RefusalsNameTheReasonAndChangeNothing) {
  IncrementalOptimizer optimizer(WithoutWindow());
  PoseGraph whole = RandomLoopGraph(528, 40);
  AddAllOf(whole, optimizer);
  optimizer.AddPoint({1.0, 1.0});
  const std::uint32_t seen = optimizer.AddConstraint(
      PointConstraint{7, 0, {1.0, 2.0}, Eigen::Matrix2d::Identity(), false});
  // Six neighbours, of which one says nothing.
  for (const std::uint32_t node : {33U, 36U}) {
    optimizer.AddConstraint(GraphConstraint{
        12,
        node,
        {},
        node == 36 ? Eigen::Matrix3d::Zero().eval() : Eigen::Matrix3d::Identity().eval(),
        false});
  }
  ASSERT_TRUE(optimizer.Update().converged);
  const PoseGraph before = optimizer.Graph();
  constexpr StatusCode kPrecondition = StatusCode::kFailedPrecondition;
  EXPECT_THAT(optimizer.MarginaliseNode(0), IsStatus(kPrecondition, "node 0: is fixed"));
  EXPECT_THAT(optimizer.MarginaliseNode(7),
              IsStatus(kPrecondition, "node 7: has point constraint"));
  EXPECT_THAT(optimizer.MarginaliseNode(12),
              IsStatus(kPrecondition, "node 12: its constraints determine 9 of 12"));
  EXPECT_THAT(optimizer.MarginaliseNode(40), IsStatus(StatusCode::kNotFound, "node 40"));
  EXPECT_THAT(optimizer.RemoveConstraint(1000), IsStatus(StatusCode::kNotFound, "constraint 1000"));
  EXPECT_THAT(optimizer.RemovePointConstraint(1), IsStatus(StatusCode::kNotFound));
  EXPECT_EQ(optimizer.Update().eliminated, 0U);
  EXPECT_EQ(optimizer.Graph().map_from_node, before.map_from_node);
  EXPECT_EQ(optimizer.Graph().constraints.size(), before.constraints.size());

  ASSERT_THAT(optimizer.RemovePointConstraint(seen), IsOk());
  EXPECT_THAT(optimizer.RemovePointConstraint(seen), IsStatus(StatusCode::kNotFound));
  EXPECT_THAT(optimizer.MarginaliseNode(7), IsOk());
  EXPECT_THAT(optimizer.MarginaliseNode(7), IsStatus(StatusCode::kNotFound, "node 7"));
  ASSERT_THAT(optimizer.RemoveConstraint(20), IsOk());
  EXPECT_THAT(optimizer.RemoveConstraint(20), IsStatus(StatusCode::kNotFound, "constraint 20"));
  ASSERT_TRUE(optimizer.Update().converged);
  ExpectBatchOptimum(optimizer);
}

TEST(IncrementalMarginalsTest, RemovedPointConstraintsLeaveTheGraphThatNeverHadThem) {
  IncrementalOptimizer optimizer(WithoutWindow());
  AddAllOf(RandomLoopGraph(529, 40), optimizer);
  const std::vector<Pose2> before = optimizer.Graph().map_from_node;
  optimizer.AddPoint({0.0, 0.0});
  std::vector<std::uint32_t> seen;
  for (int round = 0; round < 2; ++round) {
    for (const std::uint32_t node : {3U, 17U, 31U}) {
      seen.push_back(optimizer.AddConstraint(
          PointConstraint{node, 0, {1.0, 1.0}, 100.0 * Eigen::Matrix2d::Identity(), false}));
    }
    ASSERT_TRUE(optimizer.Update().converged);
    ExpectBatchOptimum(optimizer);
    EXPECT_GT(Difference(optimizer.map_from_node(31), before[31]), 0.01);
    for (const std::uint32_t index : seen) {
      ASSERT_THAT(optimizer.RemovePointConstraint(index), IsOk());
    }
    seen.clear();
    ASSERT_TRUE(optimizer.Update().converged);
    EXPECT_TRUE(optimizer.Graph().point_constraints.empty());
    for (std::uint32_t node = 0; node < 40; ++node) {
      EXPECT_LT(Difference(optimizer.map_from_node(node), before[node]), 1e-6);
    }
  }
}

TEST(IncrementalMarginalsTest, PartsThatAPointHeldTogetherComeApart) {
  IncrementalOptimizer optimizer(WithoutWindow());
  optimizer.AddNode({}, false);
  optimizer.AddNode({5.0, 0.0, 0.0}, false);
  optimizer.AddPoint({1.0, 0.0});
  const Eigen::Matrix2d information = Eigen::Matrix2d::Identity();
  optimizer.AddConstraint(PointConstraint{0, 0, {1.0, 0.0}, information, false});
  const std::uint32_t bridge =
      optimizer.AddConstraint(PointConstraint{1, 0, {-4.0, 0.0}, information, false});
  EXPECT_FALSE(optimizer.Update().determined) << "the second node may turn about the point";
  ASSERT_THAT(optimizer.RemovePointConstraint(bridge), IsOk());
  EXPECT_TRUE(optimizer.Update().converged) << "it is a component of its own, and held";
}

TEST(IncrementalMarginalsTest, JointConstraintsMayBeGiven) {
  PoseGraph whole = RandomLoopGraph(530, 60);
  RandomSequence random(531);
  IncrementalOptimizer optimizer(WithoutWindow());
  AddAllOf(whole, optimizer);
  for (const std::vector<std::uint32_t>& nodes :
       {std::vector<std::uint32_t>{0, 30, 12}, {55, 7, 33, 12}, {7, 33}}) {
    optimizer.AddConstraint(RandomJoint(nodes, whole, 0.3, 0.1, random));
    ASSERT_TRUE(optimizer.Update().converged);
    ExpectBatchOptimum(optimizer);
  }
  // One that brings two components together.
  const std::uint32_t far = optimizer.AddNode({100.0, 100.0, 3.0}, false);
  JointConstraint joint = RandomJoint({far, 20, 21}, optimizer.Graph(), 0.0, 0.0, random);
  joint.first_from_node = {
      Pose2{1.0, 0.0, 0.0},
      Pose2{1.0, 0.0, 0.0} * (Inverse(optimizer.map_from_node(20)) * optimizer.map_from_node(21))};
  optimizer.AddConstraint(joint);
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_LT(
      Difference(optimizer.map_from_node(far) * Pose2{1.0, 0.0, 0.0}, optimizer.map_from_node(20)),
      1e-3);
  ExpectBatchOptimum(optimizer);
}

// A robot that drives for long. All but the last nodes go, and those of the first round, which each
// round is tied to.
TEST(IncrementalMarginalsTest, ALongRunStaysAsLargeAsWhatItKeeps) {
  constexpr std::uint32_t kRound = 20;
  constexpr std::uint32_t kKept = 60;
  constexpr std::uint32_t kNodes = 1500;
  const PoseGraph whole = RandomLoopGraph(532, kNodes);
  IncrementalOptions options;
  options.retract_window = kKept;
  IncrementalOptimizer optimizer(options);
  std::vector<IncrementalSize> sizes;
  for (std::uint32_t node = 0; node < kNodes; ++node) {
    optimizer.AddNode(
        node == 0 ? Pose2{}
                  : optimizer.map_from_node(node - 1) *
                        (Inverse(whole.map_from_node[node - 1]) * whole.map_from_node[node]),
        node == 0);
    for (const GraphConstraint& constraint : whole.constraints) {
      if (std::max(constraint.from, constraint.to) == node) {
        GraphConstraint again = constraint;
        // Instead of the round before, the first one.
        again.from = constraint.from + 1 == node ? constraint.from : node % kRound;
        again.robust = false;
        optimizer.AddConstraint(again);
      }
    }
    ASSERT_TRUE(optimizer.Update().determined);
    if (node >= kRound + kKept) {
      ASSERT_THAT(optimizer.MarginaliseNode(node - kKept), IsOk()) << node;
    }
    if (node % 250 == 249) {
      sizes.push_back(optimizer.Size());
    }
  }
  for (const IncrementalSize& size : sizes) {
    EXPECT_LE(size.variables, kRound + kKept + 5U);
    EXPECT_LE(size.terms, 5U * (kRound + kKept));
    EXPECT_LE(size.fronts, 3U * (kRound + kKept));
    EXPECT_LE(size.joints, 2U * (kRound + kKept));
  }
  for (int i = 0; i < 20; ++i) {
    optimizer.Update();
  }
  const PoseGraph graph = optimizer.Graph();
  const PoseGraph optimum = AtOptimum(graph);
  for (std::uint32_t node = 0; node < kNodes; ++node) {
    EXPECT_LT(Difference(graph.map_from_node[node], optimum.map_from_node[node]), 0.05) << node;
  }
}

TEST(IncrementalMarginalsTest, NothingCanBeTiedToANodeThatHasGone) {
  IncrementalOptimizer optimizer(WithoutWindow());
  AddAllOf(RandomLoopGraph(534, 10), optimizer);
  optimizer.AddPoint({});
  ASSERT_THAT(optimizer.MarginaliseNode(9), IsOk());
  EXPECT_DEATH(optimizer.AddConstraint(GraphConstraint{3, 9, {}, {}, false}), "IsThere");
  EXPECT_DEATH(optimizer.AddConstraint(GraphConstraint{9, 3, {}, {}, false}), "IsThere");
  EXPECT_DEATH(optimizer.AddConstraint(GraphConstraint{3, 10, {}, {}, false}), "IsThere");
  EXPECT_DEATH(optimizer.AddConstraint(PointConstraint{9, 0, {}, {}, false}), "IsThere");
  const JointConstraint joint{{2, 3, 9}, {{}, {}}, Eigen::MatrixXd::Identity(6, 6)};
  EXPECT_DEATH(optimizer.AddConstraint(joint), "IsThere");
}

TEST(IncrementalMarginalsTest, WhatCannotBeAddedUpDoesNotKeepTheOthersApart) {
  IncrementalOptimizer optimizer(WithoutWindow());
  for (std::uint32_t node = 0; node < 3; ++node) {
    optimizer.AddNode({}, false);
  }
  // Knows that x + theta is 0: with an x of -5, it is off by more than half a turn.
  const Eigen::Vector3d known(1.0, 0.0, 1.0);
  optimizer.AddConstraint(JointConstraint{{0, 1}, {Pose2{}}, known * known.transpose()});
  optimizer.AddConstraint(JointConstraint{{0, 1}, {Pose2{}}, Eigen::Matrix3d::Identity()});
  optimizer.AddConstraint(GraphConstraint{0, 2, {}, 1e3 * Eigen::Matrix3d::Identity(), false});
  const Eigen::Matrix3d of_x = Eigen::Vector3d(1e3, 0.0, 0.0).asDiagonal();
  optimizer.AddConstraint(GraphConstraint{2, 1, {-5.0, 0.0, 0.0}, of_x, false});
  ASSERT_THAT(optimizer.MarginaliseNode(2), IsOk());
  EXPECT_EQ(optimizer.Size().joints, 2U);
  const PoseGraph graph = optimizer.Graph();
  ASSERT_EQ(graph.constraints.size(), 2U);
  EXPECT_EQ(graph.constraints[0].information, known * known.transpose());
  EXPECT_NEAR(graph.constraints[1].information(0, 0), 501.0, 1e-9);
}

TEST(IncrementalMarginalsTest, TheSameCallsGiveTheSameBits) {
  std::vector<std::vector<Pose2>> runs;
  for (int run = 0; run < 2; ++run) {
    IncrementalOptions options;
    options.retract_window = 10;
    IncrementalOptimizer optimizer(options);
    const PoseGraph whole = RandomLoopGraph(533, 120);
    for (std::uint32_t node = 0; node < 120; ++node) {
      AddNodeOf(whole, node, optimizer);
      optimizer.Update();
      if (node > 50) {
        ASSERT_THAT(optimizer.MarginaliseNode(node - 40), IsOk());
      }
    }
    runs.push_back(optimizer.Graph().map_from_node);
  }
  EXPECT_EQ(runs[0], runs[1]);
}

}  // namespace
}  // namespace loci
