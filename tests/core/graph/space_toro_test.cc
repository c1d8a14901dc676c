// SPDX-License-Identifier: Apache-2.0
// Gradient descent in space.
#include "core/graph/space_toro.h"

#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/graph/g2o_format.h"
#include "core/graph/space_problem.h"
#include "tests/core/graph/random_space_graph.h"
#include "tests/support/datasets.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

SpaceGraph Swept(SpaceGraph graph, int sweeps) {
  SpaceToroOptimizer toro(graph);
  for (int i = 0; i < sweeps; ++i) {
    toro.Sweep();
  }
  graph.map_from_node = toro.Poses();
  return graph;
}

SpaceGraph SweptFromTree(SpaceGraph graph, int sweeps) {
  PlaceByTree(BreadthFirstTree(graph), graph);
  return Swept(std::move(graph), sweeps);
}

double Angle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return a.angularDistance(b);
}

TEST(SpaceToroTest, LowersChi2ByOrdersAndKeepsHeldNodes) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const SpaceGraph graph = RandomSpaceLoops(seed, 200);
    SpaceGraph optimum = graph;
    const double best = OptimizeSparse(optimum, SparseOptions{}).chi2_after;
    const SpaceGraph swept = SweptFromTree(graph, 50);
    EXPECT_LT(Chi2(swept), 5.0 * best);
    EXPECT_GT(Chi2(graph), 100.0 * best);
    EXPECT_EQ(swept.map_from_node[0].translation, graph.map_from_node[0].translation);
    EXPECT_LT(Angle(swept.map_from_node[0].rotation, graph.map_from_node[0].rotation), 1e-12);
  }
}

TEST(SpaceToroTest, PosesAreThoseGivenBeforeTheFirstSweep) {
  const SpaceGraph graph = RandomSpaceLoops(4, 100);
  const SpaceGraph same = Swept(graph, 0);
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    const Pose3& pose = same.map_from_node[i];
    EXPECT_LT((pose.translation - graph.map_from_node[i].translation).norm(), 1e-9);
    EXPECT_LT(Angle(pose.rotation, graph.map_from_node[i].rotation), 1e-6);
  }
}

// One loop of three: after the first sweep, whose rate is 1, the last constraint is met.
TEST(SpaceToroTest, AConstraintWithRateOneIsMetWhateverItsAngle) {
  for (const double angle_rad : {0.1, 1.5, 3.0, kPi - 1e-9, kPi, -kPi, -2.5}) {
    SpaceGraph graph;
    graph.map_from_node.resize(3);
    graph.fixed = {true};
    for (std::uint32_t i = 0; i < 2; ++i) {
      SpaceConstraint constraint;
      constraint.from = i;
      constraint.to = i + 1;
      constraint.information *= 1e-6;  // gives way
      graph.constraints.push_back(constraint);
    }
    SpaceConstraint loop;
    loop.from = 2;
    loop.to = 0;
    loop.from_from_to.rotation =
        Eigen::AngleAxisd(angle_rad, Eigen::Vector3d(1.0, 2.0, -1.0).normalized());
    loop.from_from_to.translation = {1.0, -2.0, 3.0};
    loop.information *= 100.0;
    graph.constraints.push_back(loop);
    const SpaceGraph swept = Swept(graph, 1);
    EXPECT_LT(ErrorOf(swept, loop).norm(), 1e-6) << angle_rad;
  }
}

TEST(SpaceToroTest, ARigidMotionOfEverythingMovesTheResultAlong) {
  RandomSequence random(5);
  SpaceGraph graph = RandomSpaceLoops(5, 120);
  const Pose3 new_from_old = RandomPose3(random, 20.0, 3.0);
  SpaceGraph moved = graph;
  for (Pose3& pose : moved.map_from_node) {
    pose = new_from_old * pose;
  }
  graph = Swept(graph, 10);
  moved = Swept(moved, 10);
  EXPECT_NEAR(Chi2(moved), Chi2(graph), 1e-6 * Chi2(graph));
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    const Pose3 expected = new_from_old * graph.map_from_node[i];
    EXPECT_LT((moved.map_from_node[i].translation - expected.translation).norm(), 1e-6);
    EXPECT_LT(Angle(moved.map_from_node[i].rotation, expected.rotation), 1e-6);
  }
}

TEST(SpaceToroTest, SweepsGiveTheSameBitsAgain) {
  const SpaceGraph graph = RandomSpaceLoops(6, 100);
  const SpaceGraph a = Swept(graph, 20);
  const SpaceGraph b = Swept(graph, 20);
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    EXPECT_EQ(a.map_from_node[i].translation, b.map_from_node[i].translation);
    EXPECT_EQ(a.map_from_node[i].rotation.coeffs(), b.map_from_node[i].rotation.coeffs());
  }
}

TEST(SpaceToroTest, DegenerateGraphsComeBackFinite) {
  EXPECT_TRUE(Swept(SpaceGraph{}, 3).map_from_node.empty());
  SpaceGraph lonely;
  lonely.map_from_node.resize(1);
  EXPECT_EQ(Swept(lonely, 3).map_from_node.size(), 1U);

  // Two components, the second with every constraint twice, one of them without information, and a
  // constraint between two fixed nodes that nothing can meet.
  SpaceGraph graph = RandomSpaceLoops(7, 60);
  graph.fixed = {true};
  std::erase_if(graph.constraints, [](const SpaceConstraint& constraint) {
    return constraint.from < 30 && constraint.to >= 30;
  });
  const std::vector<SpaceConstraint> once = graph.constraints;
  graph.constraints.insert(graph.constraints.end(), once.begin(), once.end());
  graph.constraints.back().information.setZero();
  graph.fixed.resize(60, false);
  graph.fixed[1] = true;
  const SpaceGraph swept = Swept(graph, 20);
  for (const Pose3& pose : swept.map_from_node) {
    EXPECT_TRUE(pose.translation.allFinite());
    EXPECT_NEAR(pose.rotation.norm(), 1.0, 1e-9);
  }
  EXPECT_EQ(swept.map_from_node[1].translation, graph.map_from_node[1].translation);
  EXPECT_LT(Chi2(swept), Chi2(graph));
}

TEST(SpaceToroTest, PriorsAndPointsPlayNoPart) {
  const SpaceGraph bare = RandomSpaceLoops(8, 60);
  SpaceGraph graph = bare;
  AddPoints(9, 10, graph);
  AddPriors(10, graph);
  const SpaceGraph with = Swept(graph, 5);
  const SpaceGraph without = Swept(bare, 5);
  for (std::size_t i = 0; i < bare.map_from_node.size(); ++i) {
    EXPECT_EQ(with.map_from_node[i].translation, without.map_from_node[i].translation);
    EXPECT_EQ(with.map_from_node[i].rotation.coeffs(), without.map_from_node[i].rotation.coeffs());
  }
}

// A chain between two fixed nodes that is too long by 0.4 m and turned too far by 0.4 rad.
TEST(SpaceToroTest, SpreadsTheErrorBetweenTwoFixedNodes) {
  const auto turn = [](double angle_rad) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitX()));
  };
  SpaceGraph graph;
  graph.map_from_node = {
      Pose3{}, Pose3{{1.0, 0.0, 0.0}, turn(0.5)}, Pose3{{2.4, 0.0, 0.0}, turn(1.4)}};
  graph.fixed = {true, false, true};
  for (std::uint32_t i = 0; i < 2; ++i) {
    SpaceConstraint constraint;
    constraint.from = i;
    constraint.to = i + 1;
    constraint.from_from_to = {{1.0, 0.0, 0.0}, turn(0.5)};
    graph.constraints.push_back(constraint);
  }
  const SpaceGraph swept = Swept(graph, 1000);
  EXPECT_NEAR(swept.map_from_node[1].translation.x(), 1.2, 0.02);
  EXPECT_NEAR(Angle(swept.map_from_node[1].rotation, turn(0.7)), 0.0, 0.02);
  EXPECT_EQ(swept.map_from_node[2].translation, graph.map_from_node[2].translation);
  EXPECT_LT(Angle(swept.map_from_node[2].rotation, graph.map_from_node[2].rotation), 1e-7);
}

// Of a public graph after 50 sweeps from its tree.
void ExpectSweptBelow(const std::string& text, double chi2_max) {
  StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_THAT(parsed, IsOk());
  EXPECT_LT(Chi2(SweptFromTree(std::move(parsed->space), 50)), chi2_max);
}

// The tree begins at 3.3e6, the optimum is 727; the published program reaches 5681.
TEST(SpaceToroTest, UntanglesTheSphere) {
  LOCI_DATASET_OR_SKIP(text, "graphs/sphere2500.g2o.gz");
  ExpectSweptBelow(text, 4000.0);
}

// The tree begins at 47.6, the optimum is 1.24; the published program reaches 23.2.
TEST(SpaceToroTest, StraightensTheParkingGarage) {
  LOCI_DATASET_OR_SKIP(text, "graphs/parking-garage.g2o.gz");
  ExpectSweptBelow(text, 2.0);
}

}  // namespace
}  // namespace loci
