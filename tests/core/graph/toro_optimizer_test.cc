// SPDX-License-Identifier: Apache-2.0
// The spanning tree, and gradient descent on it.
#include "core/graph/toro_optimizer.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/graph/g2o_format.h"
#include "core/graph/recording_order.h"
#include "core/graph/sparse_optimizer.h"
#include "core/graph/toro_tree.h"
#include "tests/core/graph/growing_graph.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/datasets.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

GraphConstraint Constraint(std::uint32_t from, std::uint32_t to, const Pose2& from_from_to) {
  return {from, to, from_from_to, 100.0 * Eigen::Matrix3d::Identity(), false};
}

PoseGraph SweptFromTree(PoseGraph graph, int sweeps) {
  PlaceByTree(BreadthFirstTree(graph), graph);
  ToroOptimizer toro(graph);
  for (int i = 0; i < sweeps; ++i) {
    toro.Sweep();
  }
  graph.map_from_node = toro.Poses();
  return graph;
}

TEST(ToroTreeTest, IsBreadthFirstFromTheHeldNodes) {
  PoseGraph graph;
  graph.map_from_node.resize(7);
  graph.constraints = {Constraint(0, 1, {}),
                       Constraint(1, 2, {}),
                       Constraint(2, 3, {}),
                       Constraint(3, 0, {}),
                       Constraint(3, 4, {}),
                       Constraint(6, 5, {})};
  const ToroTree tree = BreadthFirstTree(graph);
  constexpr std::uint32_t kNone = ToroTree::kNone;
  EXPECT_EQ(tree.parent, (std::vector<std::uint32_t>{kNone, 0, 1, 0, 3, kNone, 5}));
  EXPECT_EQ(tree.depth, (std::vector<std::uint32_t>{0, 1, 2, 1, 2, 0, 1}));
  EXPECT_EQ(tree.parent_constraint, (std::vector<std::uint32_t>{kNone, 0, 1, 3, 4, kNone, 5}));
  graph.fixed = {false, false, true};
  EXPECT_EQ(BreadthFirstTree(graph).parent[0], 1U);
  EXPECT_EQ(BreadthFirstTree(graph).parent[2], kNone);
}

TEST(ToroTreeTest, ReachesNodesThatOnlyPointsJoin) {
  PoseGraph graph;
  graph.map_from_node.resize(4);
  graph.points_in_map.resize(1);
  graph.constraints = {Constraint(0, 1, {}), Constraint(2, 3, {})};
  graph.point_constraints.resize(2);
  graph.point_constraints[1].from = 3;
  const ToroTree tree = BreadthFirstTree(graph);
  EXPECT_EQ(tree.order.size(), 4U);
  EXPECT_EQ(tree.parent[2], ToroTree::kNone);
  EXPECT_EQ(tree.parent[3], 2U);
}

TEST(ToroTreeTest, PlacesNodesAndPointsAlongConstraintsInBothDirections) {
  PoseGraph graph;
  graph.map_from_node.resize(3);
  graph.map_from_node[0] = {1.0, 1.0, 0.5 * kPi};
  graph.points_in_map.resize(1);
  graph.constraints = {Constraint(1, 0, {-2.0, 0.0, 0.0}), Constraint(1, 2, {0.0, 1.0, 0.0})};
  graph.point_constraints.resize(1);
  graph.point_constraints[0].from = 2;
  graph.point_constraints[0].point_in_from = {1.0, 0.0};
  PlaceByTree(BreadthFirstTree(graph), graph);
  EXPECT_LT((graph.map_from_node[2].vector() - Eigen::Vector3d(0.0, 3.0, 0.5 * kPi)).norm(), 1e-12);
  EXPECT_LT((graph.points_in_map[0] - Eigen::Vector2d(0.0, 4.0)).norm(), 1e-12);
  EXPECT_NEAR(Chi2(graph), 0.0, 1e-20);
}

TEST(ToroOptimizerTest, LowersChi2ByOrdersAndKeepsHeldNodes) {
  PoseGraph graph = RandomLoopGraph(31, 300);
  PoseGraph optimum = graph;
  const double best = OptimizeSparse(optimum, SparseOptions{}).chi2_after;
  graph.fixed[0] = true;
  const PoseGraph swept = SweptFromTree(graph, 50);
  EXPECT_EQ(swept.map_from_node[0], graph.map_from_node[0]);
  EXPECT_LT(Chi2(swept), 2.0 * best);
  EXPECT_GT(Chi2(graph), 20.0 * best);
}

TEST(ToroOptimizerTest, SweepsGiveTheSameBitsAgain) {
  const PoseGraph graph = RandomLoopGraph(32, 100);
  EXPECT_EQ(SweptFromTree(graph, 10).map_from_node, SweptFromTree(graph, 10).map_from_node);
}

TEST(ToroOptimizerTest, ConstraintsRestWhenTheirLearningRateHasDecayed) {
  ToroOptimizer toro(RandomLoopGraph(33, 60));
  EXPECT_GT(toro.Sweep(), 90U);
  int sweeps = 1;
  while (toro.Sweep() > 0) {
    ASSERT_LT(++sweeps, 2000);
  }
}

TEST(ToroOptimizerTest, IncrementallyOnlyWhatTouchesTheNewConstraintIsWorkedOn) {
  // A long walk out along x, then a small loop at its end.
  ToroOptimizer toro((PoseGraph()));
  toro.AddNode(Pose2{}, true);
  for (std::uint32_t i = 1; i < 100; ++i) {
    toro.AddNode(Pose2{}, false);
    toro.AddConstraint(Constraint(i - 1, i, {1.0, 0.0, i >= 96 ? 0.5 * kPi : 0.0}));
  }
  while (toro.Sweep() > 0) {
  }
  const std::vector<Pose2> before = toro.Poses();
  EXPECT_NEAR(before[95].x, 95.0, 1e-9);
  toro.AddConstraint(Constraint(99, 95, {1.0, 0.1, 0.4 * kPi}));
  EXPECT_LE(toro.Sweep(), 10U);
  for (int i = 0; i < 20; ++i) {
    toro.Sweep();
  }
  const std::vector<Pose2> after = toro.Poses();
  for (std::size_t i = 0; i < 95; ++i) {
    EXPECT_EQ(after[i], before[i]);
  }
  EXPECT_NE(after[99], before[99]);
}

TEST(ToroOptimizerTest, JoinsComponentsByMovingTheLaterOne) {
  ToroOptimizer toro((PoseGraph()));
  for (int i = 0; i < 4; ++i) {
    toro.AddNode(Pose2{}, i == 0);
  }
  toro.AddConstraint(Constraint(0, 1, {1.0, 0.0, 0.0}));
  toro.AddConstraint(Constraint(2, 3, {0.0, 1.0, 0.0}));
  toro.AddConstraint(Constraint(3, 1, {0.0, 0.0, 0.5 * kPi}));
  const std::vector<Pose2> poses = toro.Poses();
  EXPECT_LT((poses[3].vector() - Eigen::Vector3d(1.0, 0.0, -0.5 * kPi)).norm(), 1e-9);
  EXPECT_LT((poses[2].vector() - Eigen::Vector3d(0.0, 0.0, -0.5 * kPi)).norm(), 1e-9);
}

TEST(ToroOptimizerTest, SpreadsTheErrorBetweenTwoFixedNodes) {
  PoseGraph graph;
  graph.map_from_node = {Pose2{}, Pose2{1.0, 0.0, 0.0}, Pose2{2.4, 0.0, 0.0}};
  graph.fixed = {true, false, true};
  graph.constraints = {Constraint(0, 1, {1.0, 0.0, 0.0}), Constraint(1, 2, {1.0, 0.0, 0.0})};
  ToroOptimizer toro(graph);
  for (int i = 0; i < 1000; ++i) {
    toro.Sweep();
  }
  EXPECT_NEAR(toro.Poses()[1].x, 1.2, 0.02);
  EXPECT_EQ(toro.Poses()[2], graph.map_from_node[2]);
}

// Node by node, as if the graph were just being recorded; after each, `visit` is told how many
// nodes there are and the optimiser.
template <typename Visit>
void GrowIncrementally(const PoseGraph& graph, Visit visit) {
  const RecordingOrder recorded(graph);
  ToroOptimizer toro((PoseGraph()));
  for (std::uint32_t i = 0; i < graph.map_from_node.size(); ++i) {
    toro.AddNode(Pose2{}, i == 0);
    for (const std::uint32_t constraint : recorded.Constraints(i)) {
      toro.AddConstraint(graph.constraints[constraint]);
    }
    toro.Update();
    visit(i + 1, toro);
  }
}

double OptimumOf(PoseGraph graph) {
  PlaceByTree(BreadthFirstTree(graph), graph);
  return OptimizeSparse(graph, SparseOptions{}).chi2_after;
}

// The largest ratio of chi2 to the optimum of the prefix, after every `step` nodes from `first` on.
double WorstRatio(const PoseGraph& graph, std::size_t first, std::size_t step) {
  double worst = 0.0;
  GrowIncrementally(graph, [&](std::size_t count, const ToroOptimizer& toro) {
    if (count >= first && (count - first) % step == 0) {
      PoseGraph prefix = PrefixOf(graph, count);
      const double optimum = OptimumOf(prefix);
      prefix.map_from_node = toro.Poses();
      worst = std::max(worst, Chi2(prefix) / optimum);
    }
  });
  return worst;
}

TEST(ToroOptimizerTest, UpdatesCloseTheLoopsOfAManhattanWorld) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const PoseGraph graph = RandomManhattanGraph(seed, 600);
    ASSERT_GT(Chi2(graph), 100.0 * OptimumOf(graph));
    EXPECT_LT(WorstRatio(graph, 300, 60), 2.0) << "seed " << seed;
  }
}

TEST(ToroOptimizerTest, AnUpdateWithoutALoopDoesNothing) {
  const PoseGraph graph = RandomManhattanGraph(4, 200);
  ToroOptimizer toro(graph);
  while (toro.Update() > 0) {
  }
  const std::vector<Pose2> before = toro.Poses();
  const std::uint32_t added = toro.AddNode(Pose2{}, false);
  toro.AddConstraint(Constraint(added - 1, added, {1.0, 0.0, 0.0}));
  EXPECT_EQ(toro.Update(), 0U);
  std::vector<Pose2> after = toro.Poses();
  after.pop_back();
  EXPECT_EQ(after, before);
}

TEST(ToroOptimizerTest, ALoopThatFitsDoesNotOpenTheOthers) {
  PoseGraph graph = RandomManhattanGraph(5, 300);
  ToroOptimizer toro(graph);
  for (int i = 0; i < 100; ++i) {
    toro.Update();
  }
  graph.map_from_node = toro.Poses();
  const double before = Chi2(graph);
  toro.AddConstraint(
      Constraint(299, 3, Inverse(graph.map_from_node[299]) * graph.map_from_node[3]));
  toro.Update();
  graph.map_from_node = toro.Poses();
  EXPECT_LT(Chi2(graph), 1.05 * before);
}

TEST(ToroOptimizerTest, UpdatesGoOnUntilNoNodeWaits) {
  const PoseGraph graph = RandomManhattanGraph(6, 400);
  ToroOptimizer toro(graph);
  int updates = 1;
  while (toro.Update() > 0) {
    ASSERT_LT(++updates, 100);
  }
  const std::vector<Pose2> rest = toro.Poses();
  EXPECT_EQ(toro.Update(), 0U);
  EXPECT_EQ(toro.Poses(), rest);
}

TEST(ToroOptimizerTest, SortedConstraintsGiveTheSameBitsInWhateverOrderTheyCame) {
  PoseGraph graph = RandomManhattanGraph(7, 150);
  PoseGraph shuffled = graph;
  RandomSequence random(8);
  for (std::size_t i = shuffled.constraints.size() - 1; i > 0; --i) {
    std::swap(shuffled.constraints[i], shuffled.constraints[random.NextBits() % (i + 1)]);
  }
  SortConstraints(graph);
  SortConstraints(shuffled);
  ToroOptimizer a(graph);
  ToroOptimizer b(shuffled);
  for (int i = 0; i < 5; ++i) {
    a.Sweep();
    b.Sweep();
  }
  a.Update();
  b.Update();
  EXPECT_EQ(a.Poses(), b.Poses());
}

TEST(ToroOptimizerTest, UpdatesGiveTheSameBitsAgain) {
  const PoseGraph graph = RandomManhattanGraph(9, 300);
  std::vector<std::vector<Pose2>> runs;
  for (int run = 0; run < 2; ++run) {
    GrowIncrementally(graph, [&](std::size_t count, const ToroOptimizer& toro) {
      if (count == graph.map_from_node.size()) {
        runs.push_back(toro.Poses());
      }
    });
  }
  EXPECT_EQ(runs[0], runs[1]);
}

TEST(ToroOptimizerTest, ARigidMotionOfEverythingMovesTheResultAlong) {
  const PoseGraph graph = RandomManhattanGraph(10, 200);
  const Pose2 new_from_old{31.0, -7.0, 2.9};
  ToroOptimizer toro(graph);
  ToroOptimizer moved(Moved(new_from_old, graph));
  for (int i = 0; i < 20; ++i) {
    toro.Sweep();
    moved.Sweep();
  }
  PoseGraph expected = graph;
  expected.map_from_node = toro.Poses();
  PoseGraph result = graph;
  result.map_from_node = moved.Poses();
  EXPECT_NEAR(Chi2(result), Chi2(expected), 1e-6 * Chi2(expected));
  for (std::size_t i = 0; i < expected.map_from_node.size(); ++i) {
    const Pose2 difference =
        Inverse(new_from_old * expected.map_from_node[i]) * result.map_from_node[i];
    EXPECT_LT(difference.vector().norm(), 1e-6);
  }
}

// Three nodes in a ring whose turns add up to `angle_rad` while the odometry gives way.
TEST(ToroOptimizerTest, AConstraintWithRateOneIsMetWhateverItsAngle) {
  for (const double angle_rad : {0.1, 3.0, kPi - 1e-12, kPi, -kPi + 1e-12, -2.5}) {
    PoseGraph graph;
    graph.map_from_node = {Pose2{}, Pose2{1.0, 0.0, 2.0}, Pose2{2.0, 1.0, -2.0}};
    graph.fixed = {true};
    graph.constraints = {Constraint(0, 1, graph.map_from_node[1]),
                         Constraint(1, 2, Inverse(graph.map_from_node[1]) * graph.map_from_node[2]),
                         Constraint(2, 0, {1.0, -2.0, angle_rad})};
    graph.constraints[0].information *= 1e-8;
    graph.constraints[1].information *= 1e-8;
    ToroOptimizer toro(graph);
    toro.Sweep();
    graph.map_from_node = toro.Poses();
    EXPECT_LT(ErrorOf(graph, graph.constraints[2]).norm(), 1e-6) << angle_rad;
    for (const Pose2& pose : graph.map_from_node) {
      EXPECT_EQ(pose.theta, WrapAngle(pose.theta));
    }
  }
}

TEST(ToroOptimizerTest, DegenerateGraphsComeBackFinite) {
  ToroOptimizer empty((PoseGraph()));
  EXPECT_EQ(empty.Sweep(), 0U);
  EXPECT_EQ(empty.Update(), 0U);
  EXPECT_TRUE(empty.Poses().empty());

  PoseGraph lonely;
  lonely.map_from_node = {Pose2{1.0, 2.0, 3.0}};
  ToroOptimizer one(lonely);
  EXPECT_EQ(one.Sweep(), 0U);
  EXPECT_EQ(one.Poses(), lonely.map_from_node);

  // Two components, every constraint twice, and some that say nothing.
  PoseGraph graph = RandomManhattanGraph(11, 100);
  std::erase_if(graph.constraints, [](const GraphConstraint& constraint) {
    return (constraint.from < 50) != (constraint.to < 50);
  });
  const std::vector<GraphConstraint> once = graph.constraints;
  graph.constraints.insert(graph.constraints.end(), once.begin(), once.end());
  for (std::size_t i = 0; i < graph.constraints.size(); i += 7) {
    graph.constraints[i].information.setZero();
  }
  const double before = Chi2(graph);
  ToroOptimizer toro(graph);
  for (int i = 0; i < 20; ++i) {
    toro.Sweep();
  }
  toro.Update();
  PoseGraph swept = graph;
  swept.map_from_node = toro.Poses();
  for (const Pose2& pose : swept.map_from_node) {
    EXPECT_TRUE(pose.vector().allFinite());
  }
  EXPECT_EQ(swept.map_from_node[50], graph.map_from_node[50]);
  EXPECT_LT(Chi2(swept), before);
}

TEST(ToroOptimizerTest, SeveralComponentsAreDescendedAsIfEachWereAlone) {
  const PoseGraph first = RandomManhattanGraph(13, 120);
  const PoseGraph second = RandomManhattanGraph(14, 90);
  PoseGraph both = first;
  both.fixed.resize(first.map_from_node.size(), false);
  both.map_from_node.insert(
      both.map_from_node.end(), second.map_from_node.begin(), second.map_from_node.end());
  for (GraphConstraint constraint : second.constraints) {
    constraint.from += 120;
    constraint.to += 120;
    both.constraints.push_back(constraint);
  }
  std::vector<Pose2> expected = SweptFromTree(first, 20).map_from_node;
  const std::vector<Pose2> rest = SweptFromTree(second, 20).map_from_node;
  expected.insert(expected.end(), rest.begin(), rest.end());
  EXPECT_EQ(SweptFromTree(both, 20).map_from_node, expected);
}

TEST(ToroOptimizerTest, PriorsAndPointsPlayNoPart) {
  const PoseGraph bare = RandomManhattanGraph(15, 100);
  PoseGraph graph = bare;
  AddPoints(16, 20, graph);
  AddPriors(17, graph);
  ToroOptimizer with(graph);
  ToroOptimizer without(bare);
  for (int i = 0; i < 5; ++i) {
    with.Sweep();
    without.Sweep();
  }
  with.Update();
  without.Update();
  EXPECT_EQ(with.Poses(), without.Poses());
}

TEST(ToroOptimizerTest, AComponentThatPriorsTieToTheMapKeepsItsLowestNode) {
  PoseGraph graph = RandomManhattanGraph(18, 80);
  graph.fixed.clear();
  AddPriors(19, graph);
  ToroOptimizer toro(graph);
  for (int i = 0; i < 5; ++i) {
    toro.Sweep();
  }
  EXPECT_EQ(toro.Poses()[0], graph.map_from_node[0]);
  EXPECT_NE(toro.Poses()[79], graph.map_from_node[79]);
}

TEST(ToroOptimizerTest, ConstraintsWithoutInformationMoveNothing) {
  PoseGraph graph = RandomManhattanGraph(12, 60);
  for (GraphConstraint& constraint : graph.constraints) {
    constraint.information.setZero();
  }
  ToroOptimizer toro(graph);
  toro.Sweep();
  toro.Update();
  const std::vector<Pose2> poses = toro.Poses();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_LT((Inverse(graph.map_from_node[i]) * poses[i]).vector().norm(), 1e-9);
  }
}

// The published program reaches 286 after 50 sweeps.
TEST(ToroOptimizerTest, ClosesTheLoopsOfManhattan) {
  LOCI_DATASET_OR_SKIP(text, "graphs/manhattanOlson3500.g2o.gz");
  const StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_THAT(parsed, IsOk());
  EXPECT_GT(Chi2(parsed->plane), 60000.0);
  EXPECT_LT(Chi2(SweptFromTree(parsed->plane, 50)), 240.0);
}

// The published program closes none: chi2 2.6e6.
TEST(ToroOptimizerTest, ClosesTheLoopsOfManhattanIncrementally) {
  LOCI_DATASET_OR_SKIP(text, "graphs/manhattanOlson3500.g2o.gz");
  const StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_THAT(parsed, IsOk());
  EXPECT_LT(WorstRatio(parsed->plane, 500, 500), 2.0);
}

}  // namespace
}  // namespace loci
