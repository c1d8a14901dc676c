// SPDX-License-Identifier: Apache-2.0
// The incremental optimiser against the batch one, while a graph grows, loses constraints and is
// joined.
#include "core/graph/incremental_optimizer.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/exact_options.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

double OptimumNear(PoseGraph graph) {
  return OptimizeSparse(graph, SparseOptions{}).chi2_after;
}

// Adds the nodes of a graph one by one, each with its constraints to those before. Calls
// `on_update` after each.
template <typename OnUpdate>
void Replay(const PoseGraph& whole, IncrementalOptimizer& optimizer, const OnUpdate& on_update) {
  for (std::uint32_t node = 0; node < whole.map_from_node.size(); ++node) {
    optimizer.AddNode(whole.map_from_node[node], whole.IsFixed(node));
    for (const GraphConstraint& constraint : whole.constraints) {
      if (std::max(constraint.from, constraint.to) == node) {
        optimizer.AddConstraint(constraint);
      }
    }
    on_update(node, optimizer.Update());
  }
}

TEST(IncrementalOptimizerTest, IsAtTheOptimumOfEveryPrefix) {
  IncrementalOptimizer optimizer(ExactOptions());
  Replay(RandomLoopGraph(1, 150), optimizer, [&](std::uint32_t node, const UpdateSummary& update) {
    EXPECT_TRUE(update.converged) << node;
    if (node % 10 == 9) {
      const PoseGraph graph = optimizer.Graph();
      EXPECT_NEAR(Chi2(graph), OptimumNear(graph), 1e-6 * (1.0 + Chi2(graph))) << node;
    }
  });
}

TEST(IncrementalOptimizerTest, WithDefaultsIsWithinAHundredthOfTheOptimum) {
  IncrementalOptimizer optimizer((IncrementalOptions()));
  Replay(RandomLoopGraph(2, 400), optimizer, [&](std::uint32_t node, const UpdateSummary& update) {
    EXPECT_TRUE(update.determined);
    if (node % 20 == 19) {
      const PoseGraph graph = optimizer.Graph();
      EXPECT_LE(Chi2(graph), 1.01 * OptimumNear(graph) + 1e-3) << node;
    }
  });
}

TEST(IncrementalOptimizerTest, ANodeWithoutALoopCostsTheSameInALargeGraph) {
  PoseGraph graph = RandomLoopGraph(3, 1000);
  IncrementalOptimizer optimizer((IncrementalOptions()));
  Replay(graph, optimizer, [](std::uint32_t, const UpdateSummary&) {});
  for (std::uint32_t node = 1000; node < 1050; ++node) {
    const Pose2 step{1.0, 0.0, 0.1};
    optimizer.AddNode(optimizer.map_from_node(node - 1) * step, false);
    optimizer.AddConstraint(
        GraphConstraint{node - 1, node, step, Eigen::Matrix3d::Identity(), false});
    EXPECT_LE(optimizer.Update().eliminated, 200U) << node;
  }
}

TEST(IncrementalOptimizerTest, AfterRandomAdditionsAndRemovalsItIsAtTheBatchOptimum) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    RandomSequence random(seed);
    const PoseGraph whole = RandomLoopGraph(seed, 120);
    IncrementalOptimizer optimizer(ExactOptions());
    std::vector<std::uint32_t> loops;
    for (std::uint32_t node = 0; node < whole.map_from_node.size(); ++node) {
      optimizer.AddNode(whole.map_from_node[node], whole.IsFixed(node));
      for (const GraphConstraint& constraint : whole.constraints) {
        if (std::max(constraint.from, constraint.to) == node) {
          const std::uint32_t index = optimizer.AddConstraint(constraint);
          if (constraint.from + 1 != constraint.to) {
            loops.push_back(index);
          }
        }
      }
      if (loops.size() > 3 && random.NextBits() % 4 == 0) {
        const std::size_t which = random.NextBits() % loops.size();
        ASSERT_THAT(optimizer.RemoveConstraint(loops[which]), IsOk());
        loops.erase(loops.begin() + static_cast<std::ptrdiff_t>(which));
      }
      if (random.NextBits() % 3 == 0) {
        EXPECT_TRUE(optimizer.Update().determined);
      }
    }
    ASSERT_TRUE(optimizer.Update().converged);
    const PoseGraph graph = optimizer.Graph();
    EXPECT_NEAR(Chi2(graph), OptimumNear(graph), 1e-6 * Chi2(graph));
  }
}

TEST(IncrementalOptimizerTest, ARemovedConstraintLeavesTheGraphThatNeverHadIt) {
  const PoseGraph whole = RandomLoopGraph(4, 100);
  IncrementalOptimizer with(ExactOptions());
  Replay(whole, with, [](std::uint32_t, const UpdateSummary&) {});
  const double chi2 = Chi2(with.Graph());
  const GraphConstraint wrong{5, 77, {3.0, 1.0, 2.0}, 100.0 * Eigen::Matrix3d::Identity(), false};
  const std::uint32_t index = with.AddConstraint(wrong);
  with.Update();
  EXPECT_GT(Chi2(with.Graph()), 2.0 * chi2);
  ASSERT_THAT(with.RemoveConstraint(index), IsOk());
  ASSERT_TRUE(with.Update().converged);
  EXPECT_NEAR(Chi2(with.Graph()), chi2, 1e-6 * chi2);
}

TEST(IncrementalOptimizerTest, ARemovedConstraintNoLongerDecidesWhatIsLinearisedAgain) {
  std::vector<std::size_t> relinearised;
  for (const bool had_it : {false, true}) {
    IncrementalOptimizer optimizer((IncrementalOptions()));
    PoseGraph whole = RandomLoopGraph(7, 100);
    Replay(whole, optimizer, [](std::uint32_t, const UpdateSummary&) {});
    for (int i = 0; i < 20; ++i) {
      optimizer.Update();
    }
    if (had_it) {  // stiff, and far
      const std::uint32_t index = optimizer.AddConstraint(
          GraphConstraint{5, 77, {1000.0, 0.0, 0.0}, 1e8 * Eigen::Matrix3d::Identity(), false});
      ASSERT_THAT(optimizer.RemoveConstraint(index), IsOk());
    }
    const Pose2 now = Inverse(optimizer.map_from_node(3)) * optimizer.map_from_node(79);
    optimizer.AddConstraint(GraphConstraint{
        3, 79, now * Pose2{0.01, 0.01, 0.001}, 100.0 * Eigen::Matrix3d::Identity(), false});
    relinearised.push_back(optimizer.Update().relinearised);
  }
  EXPECT_EQ(relinearised[0], relinearised[1]);
}

TEST(IncrementalOptimizerTest, APairThatAPointStillJoinsStaysTogether) {
  // 0 and 1 are joined by a constraint and by points through 2; the constraint goes.
  IncrementalOptimizer optimizer(ExactOptions());
  for (std::uint32_t node = 0; node < 4; ++node) {
    optimizer.AddNode({1.0 * node, 0.0, 0.0}, false);
  }
  const Eigen::Matrix3d information = 100.0 * Eigen::Matrix3d::Identity();
  const std::uint32_t direct =
      optimizer.AddConstraint(GraphConstraint{0, 1, {1.0, 0.0, 0.0}, information, false});
  optimizer.AddConstraint(GraphConstraint{1, 2, {1.0, 0.0, 0.0}, information, false});
  const std::uint32_t tail =
      optimizer.AddConstraint(GraphConstraint{1, 3, {2.0, 0.0, 0.0}, information, false});
  for (std::uint32_t point = 0; point < 2; ++point) {
    const Eigen::Vector2d at(1.0, point == 0 ? 3.0 : -3.0);
    optimizer.AddPoint(at);
    for (const std::uint32_t node : {0U, 2U}) {
      optimizer.AddConstraint(PointConstraint{
          node, point, at - Eigen::Vector2d(node, 0.0), Eigen::Matrix2d::Identity(), false});
    }
  }
  ASSERT_TRUE(optimizer.Update().converged);
  ASSERT_THAT(optimizer.RemoveConstraint(direct), IsOk());
  ASSERT_THAT(optimizer.RemoveConstraint(tail), IsOk());
  optimizer.AddConstraint(GraphConstraint{0, 2, {4.0, 0.0, 0.0}, information, false});
  optimizer.AddConstraint(GraphConstraint{0, 2, {4.0, 0.0, 0.0}, 1e4 * information, false});
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_NEAR(optimizer.map_from_node(1).x, 3.0, 0.1) << "is not held, and goes with 2";
  EXPECT_EQ(optimizer.map_from_node(0), Pose2{});
  const Pose2 alone = optimizer.map_from_node(3);
  EXPECT_NEAR(alone.x, 3.0, 1e-9) << "is held where it was";
}

TEST(IncrementalOptimizerTest, PointsAreMovedWithTheNodesThatSeeThem) {
  RandomSequence random(9);
  PoseGraph graph = RandomLoopGraph(5, 60);
  const std::vector<Pose2> truth = graph.map_from_node;
  IncrementalOptimizer optimizer(ExactOptions());
  Replay(graph, optimizer, [](std::uint32_t, const UpdateSummary&) {});
  for (std::uint32_t point = 0; point < 8; ++point) {
    const Eigen::Vector2d seen(random.NextUniform(1.0, 5.0), random.NextUniform(-2.0, 2.0));
    optimizer.AddPoint(optimizer.map_from_node(point * 5) * seen);
    optimizer.AddConstraint(
        PointConstraint{point * 5, point, seen, 50.0 * Eigen::Matrix2d::Identity(), false});
    const Eigen::Vector2d again =
        Inverse(optimizer.map_from_node(point * 5 + 20)) * optimizer.point_in_map(point);
    optimizer.AddConstraint(PointConstraint{point * 5 + 20,
                                            point,
                                            again + Eigen::Vector2d(0.2, -0.1),
                                            50.0 * Eigen::Matrix2d::Identity(),
                                            false});
    ASSERT_TRUE(optimizer.Update().converged);
    const PoseGraph now = optimizer.Graph();
    EXPECT_NEAR(Chi2(now), OptimumNear(now), 1e-6 * Chi2(now));
  }
}

TEST(IncrementalOptimizerTest, AJoinMovesTheLaterComponentAsAWhole) {
  IncrementalOptimizer optimizer(ExactOptions());
  const Eigen::Matrix3d information = 100.0 * Eigen::Matrix3d::Identity();
  const Pose2 step{1.0, 0.0, 0.2};
  for (std::uint32_t node = 0; node < 10; ++node) {
    optimizer.AddNode({node < 5 ? 1.0 : 50.0, 7.0, 1.0}, false);
    if (node % 5 != 0) {
      optimizer.AddConstraint(GraphConstraint{node - 1, node, step, information, false});
    }
  }
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_EQ(optimizer.map_from_node(5), (Pose2{50.0, 7.0, 1.0})) << "holds its component";
  optimizer.AddConstraint(GraphConstraint{2, 8, {0.0, 3.0, 0.5}, information, false});
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_EQ(optimizer.map_from_node(0), (Pose2{1.0, 7.0, 1.0}));
  EXPECT_LT(Chi2(optimizer.Graph()), 1e-12);
}

TEST(IncrementalOptimizerTest, APartThatIsCutOffHoldsItsLowestNode) {
  IncrementalOptimizer optimizer(ExactOptions());
  const Eigen::Matrix3d information = 100.0 * Eigen::Matrix3d::Identity();
  std::uint32_t bridge = 0;
  for (std::uint32_t node = 0; node < 6; ++node) {
    optimizer.AddNode({}, false);
    if (node > 0) {
      const std::uint32_t index = optimizer.AddConstraint(
          GraphConstraint{node - 1, node, {2.0, 0.0, 0.0}, information, false});
      bridge = node == 3 ? index : bridge;
    }
  }
  ASSERT_TRUE(optimizer.Update().converged);
  ASSERT_THAT(optimizer.RemoveConstraint(bridge), IsOk());
  optimizer.AddConstraint(GraphConstraint{4, 5, {3.0, 0.0, 0.0}, information, false});
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_NEAR(optimizer.map_from_node(3).x, 6.0, 1e-9);
  EXPECT_NEAR(optimizer.map_from_node(5).x, 6.0 + 2.0 + 2.5, 1e-9);
  // And joined again.
  optimizer.AddConstraint(GraphConstraint{2, 3, {5.0, 0.0, 0.0}, information, false});
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_NEAR(optimizer.map_from_node(3).x, 9.0, 1e-9);
}

double RobustCost(const PoseGraph& graph, const RobustKernel& kernel) {
  double cost = 0.0;
  for (const GraphConstraint& constraint : graph.constraints) {
    const double chi2 = Chi2Of(graph, constraint);
    cost += constraint.robust ? kernel.Rho(chi2) : chi2;
  }
  return cost;
}

TEST(IncrementalOptimizerTest, RobustConstraintsEndAtTheOptimumOfTheKernel) {
  IncrementalOptions options = ExactOptions();
  options.kernel = {RobustKernel::Shape::kCauchy, 2.0};
  options.reweigh = 1e-9;
  IncrementalOptimizer optimizer(options);
  PoseGraph whole = RandomLoopGraph(11, 120);
  for (std::size_t i = 0; i < whole.constraints.size(); i += 9) {  // some are off by much
    if (whole.constraints[i].robust) {
      whole.constraints[i].from_from_to = whole.constraints[i].from_from_to * Pose2{0.5, 0.3, 0.2};
    }
  }
  Replay(whole, optimizer, [&](std::uint32_t node, const UpdateSummary& update) {
    ASSERT_TRUE(update.converged) << node;
    if (node % 20 == 19) {
      PoseGraph graph = optimizer.Graph();
      const double cost = RobustCost(graph, options.kernel);
      SparseOptions batch;
      batch.kernel = options.kernel;
      OptimizeSparse(graph, batch);
      EXPECT_NEAR(cost, RobustCost(graph, options.kernel), 1e-6 * (1.0 + cost)) << node;
    }
  });
}

TEST(IncrementalOptimizerTest, ARightClosureFarOffIsBelievedBeforeItIsWeighed) {
  // A loop of 100 nodes whose odometry turns too far: the ends are apart by hundreds of sigma of
  // the closure, which by the kernel would hardly pull.
  IncrementalOptions options = ExactOptions();
  options.kernel = {RobustKernel::Shape::kCauchy, 1.0};
  IncrementalOptimizer optimizer(options);
  const Eigen::Matrix3d loose = Eigen::Vector3d(100.0, 100.0, 100.0).asDiagonal();
  optimizer.AddNode({}, true);
  const Pose2 step{1.0, 0.0, 2.0 * kPi / 100.0 * 1.05};
  for (std::uint32_t node = 1; node <= 100; ++node) {
    optimizer.AddNode({}, false);
    optimizer.AddConstraint(GraphConstraint{node - 1, node, step, loose, false});
  }
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_GT(optimizer.map_from_node(100).translation().norm(), 0.5);
  optimizer.AddConstraint(GraphConstraint{0, 100, {}, 1e6 * Eigen::Matrix3d::Identity(), true});
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_LT(optimizer.map_from_node(100).translation().norm(), 0.01);
}

TEST(IncrementalOptimizerTest, AGraphThatIsLoadedStaysWhereItIsAndGoesOnFromThere) {
  PoseGraph whole = RandomLoopGraph(12, 90);
  AddPoints(12, 20, whole);
  OptimizeSparse(whole, SparseOptions{});
  IncrementalOptimizer optimizer(ExactOptions());
  optimizer.Load(whole);
  for (std::uint32_t node = 0; node < 90; ++node) {
    EXPECT_EQ(optimizer.map_from_node(node), whole.map_from_node[node]) << node;
  }
  ASSERT_TRUE(optimizer.Update().converged);
  EXPECT_NEAR(Chi2(optimizer.Graph()), Chi2(whole), 1e-9 * Chi2(whole));
  const std::uint32_t next = optimizer.AddNode({}, false);
  const Eigen::Matrix3d information = 100.0 * Eigen::Matrix3d::Identity();
  optimizer.AddConstraint(GraphConstraint{89, next, {4.0, 0.0, 0.0}, information, false});
  optimizer.AddConstraint(GraphConstraint{70, next, {0.1, 0.2, 0.1}, information, false});
  ASSERT_TRUE(optimizer.Update().converged);
  const PoseGraph graph = optimizer.Graph();
  EXPECT_NEAR(Chi2(graph), OptimumNear(graph), 1e-6 * Chi2(graph));
}

TEST(IncrementalOptimizerTest, CovariancesAreThoseOfTheBatch) {
  IncrementalOptimizer optimizer(ExactOptions());
  Replay(RandomLoopGraph(13, 80), optimizer, [](std::uint32_t, const UpdateSummary&) {});
  ASSERT_TRUE(optimizer.Factorise());
  StatusOr<GraphCovariance> batch = GraphCovariance::Compute(optimizer.Graph(), RobustKernel{});
  ASSERT_THAT(batch, IsOk());
  for (std::uint32_t from = 0; from < 80; from += 9) {
    for (std::uint32_t to = 0; to < 80; to += 13) {
      const Eigen::Matrix3d expected = batch->Relative(from, to);
      EXPECT_LE((optimizer.RelativeCovariance(from, to) - expected).norm(), 1e-7 * expected.norm())
          << from << " " << to;
    }
  }
}

TEST(IncrementalOptimizerTest, NothingMovesWhileSomethingIsLoose) {
  IncrementalOptimizer optimizer(ExactOptions());
  optimizer.AddNode({}, false);
  optimizer.AddNode({1.0, 0.0, 0.0}, false);
  optimizer.AddConstraint(GraphConstraint{0, 1, {2.0, 0.0, 0.0}, Eigen::Matrix3d::Zero(), false});
  EXPECT_FALSE(optimizer.Update().determined);
  optimizer.AddConstraint(
      GraphConstraint{0, 1, {2.0, 0.0, 0.0}, Eigen::Matrix3d::Identity(), false});
  EXPECT_TRUE(optimizer.Update().converged);
  EXPECT_NEAR(optimizer.map_from_node(1).x, 2.0, 1e-9);
}

TEST(IncrementalOptimizerTest, WithoutConstraintsNothingHappens) {
  IncrementalOptimizer optimizer((IncrementalOptions()));
  EXPECT_TRUE(optimizer.Update().converged);
  optimizer.AddNode({1.0, 2.0, 3.0}, false);
  EXPECT_TRUE(optimizer.Update().converged);
  EXPECT_EQ(optimizer.map_from_node(0), (Pose2{1.0, 2.0, 3.0}));
}

TEST(IncrementalOptimizerTest, TheSameConstraintsGiveTheSameBits) {
  const PoseGraph whole = RandomLoopGraph(6, 200);
  IncrementalOptimizer first((IncrementalOptions()));
  IncrementalOptimizer second((IncrementalOptions()));
  Replay(whole, first, [](std::uint32_t, const UpdateSummary&) {});
  Replay(whole, second, [](std::uint32_t, const UpdateSummary&) {});
  EXPECT_EQ(first.Graph().map_from_node, second.Graph().map_from_node);
}

}  // namespace
}  // namespace loci
