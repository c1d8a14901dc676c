// SPDX-License-Identifier: Apache-2.0
// The chordal relaxation.
#include "core/graph/chordal_start.h"

#include <gtest/gtest.h>

#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_space_graph.h"

namespace loci {
namespace {

// Loops without noise, whose given poses say nothing.
PoseGraph ExactLoops(std::uint64_t seed) {
  RandomSequence random(seed);
  PoseGraph graph;
  for (int i = 0; i < 30; ++i) {
    graph.map_from_node.push_back(RandomPose(random, 10.0, kPi));
  }
  for (std::uint32_t i = 0; i < 30; ++i) {
    for (const std::uint32_t j : {i + 1, i + 7}) {
      if (j < 30) {
        graph.constraints.push_back({i,
                                     j,
                                     Inverse(graph.map_from_node[i]) * graph.map_from_node[j],
                                     RandomInformation(random),
                                     false});
      }
    }
  }
  AddPoints(seed + 1, 5, graph);
  for (PointConstraint& constraint : graph.point_constraints) {
    constraint.point_in_from =
        Inverse(graph.map_from_node[constraint.from]) * graph.points_in_map[constraint.point];
  }
  return graph;
}

TEST(ChordalStartTest, IsExactWithoutNoise) {
  const PoseGraph truth = ExactLoops(401);
  PoseGraph graph = truth;
  RandomSequence random(402);
  for (std::size_t i = 1; i < graph.map_from_node.size(); ++i) {
    graph.map_from_node[i] = RandomPose(random, 100.0, kPi);
  }
  for (Eigen::Vector2d& point : graph.points_in_map) {
    point *= 100.0;
  }
  PlaceByChords(graph);
  EXPECT_LT(Chi2(graph), 1e-12);
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    EXPECT_LT((Inverse(truth.map_from_node[i]) * graph.map_from_node[i]).vector().norm(), 1e-8);
  }
}

TEST(ChordalStartTest, IsExactWithoutNoiseInSpace) {
  SpaceGraph truth = RandomSpaceGraph(403, 30);
  for (SpaceConstraint& constraint : truth.constraints) {
    constraint.from_from_to =
        Inverse(truth.map_from_node[constraint.from]) * truth.map_from_node[constraint.to];
  }
  SpaceGraph graph = truth;
  RandomSequence random(404);
  for (std::size_t i = 1; i < graph.map_from_node.size(); ++i) {
    graph.map_from_node[i] = RandomPose3(random, 100.0, 3.0);
  }
  PlaceByChords(graph);
  EXPECT_LT(Chi2(graph), 1e-12);
}

TEST(ChordalStartTest, IsNearTheOptimumWhereOdometryIsFar) {
  PoseGraph graph = RandomLoopGraph(405, 300);
  const double by_odometry = Chi2(graph);
  PoseGraph optimum = graph;
  OptimizeSparse(optimum, SparseOptions{});
  PlaceByChords(graph);
  EXPECT_LT(Chi2(graph), 2.0 * Chi2(optimum));
  EXPECT_GT(by_odometry, 100.0 * Chi2(graph));
}

TEST(ChordalStartTest, FixedNodesAndPointsStay) {
  PoseGraph graph = RandomLoopGraph(406, 60);
  AddPoints(407, 4, graph);
  graph.fixed.assign(60, false);
  graph.fixed[3] = true;
  graph.fixed[40] = true;
  graph.fixed_points = {false, true};
  const PoseGraph before = graph;
  PlaceByChords(graph);
  EXPECT_EQ(graph.map_from_node[3], before.map_from_node[3]);
  EXPECT_EQ(graph.map_from_node[40], before.map_from_node[40]);
  EXPECT_EQ(graph.points_in_map[1], before.points_in_map[1]);
  EXPECT_FALSE(graph.map_from_node[30] == before.map_from_node[30]);
}

TEST(ChordalStartTest, ComponentsDoNotDisturbEachOther) {
  const PoseGraph one = ExactLoops(408);
  PoseGraph both = one;
  const auto shift = static_cast<std::uint32_t>(one.map_from_node.size());
  for (const Pose2& pose : one.map_from_node) {
    both.map_from_node.push_back(Pose2{50.0, 0.0, 1.0} * pose);
  }
  for (GraphConstraint constraint : one.constraints) {
    constraint.from += shift;
    constraint.to += shift;
    both.constraints.push_back(constraint);
  }
  const PoseGraph before = both;
  PlaceByChords(both);
  for (std::size_t i = 0; i < both.map_from_node.size(); ++i) {
    EXPECT_LT((Inverse(before.map_from_node[i]) * both.map_from_node[i]).vector().norm(), 1e-8);
  }
}

}  // namespace
}  // namespace loci
