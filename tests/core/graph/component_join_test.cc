// SPDX-License-Identifier: Apache-2.0
// Components that are moved to each other, or stay.
#include "core/graph/component_join.h"

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/core/graph/random_graph.h"

namespace loci {
namespace {

constexpr std::uint32_t kA = 1;
constexpr std::uint32_t kB = 4;

// Nodes 0 to 2 and 3 to 5 are a component each; a point belongs to each.
PoseGraph TwoComponents() {
  RandomSequence random(91);
  PoseGraph graph;
  for (std::uint32_t i = 0; i < 6; ++i) {
    graph.map_from_node.push_back(RandomPose(random, 10.0, kPi));
    if (i % 3 > 0) {
      graph.constraints.push_back({i - 1, i, Pose2{1.0, 0.0, 0.0}});
    }
  }
  graph.points_in_map = {{1.0, 2.0}, {3.0, 4.0}};
  graph.point_constraints.resize(2);
  graph.point_constraints[1].from = 5;
  graph.point_constraints[1].point = 1;
  return graph;
}

Pose2 Between(const PoseGraph& graph, std::uint32_t from, std::uint32_t to) {
  return Inverse(graph.map_from_node[from]) * graph.map_from_node[to];
}

Eigen::Vector2d PointFrom(const PoseGraph& graph, std::uint32_t node, std::size_t point) {
  return Inverse(graph.map_from_node[node]) * graph.points_in_map[point];
}

void ExpectSame(const Pose2& pose, const Pose2& expected) {
  EXPECT_LT((Inverse(expected) * pose).vector().norm(), 1e-9);
}

// That `graph` was joined with the component of nodes `first_moved` to first_moved + 2 moved in one
// piece, and the other one left alone.
void ExpectJoined(const PoseGraph& graph, const Pose2& a_from_b, std::uint32_t first_moved) {
  const PoseGraph before = TwoComponents();
  const std::uint32_t first_left = 3 - first_moved;
  ExpectSame(Between(graph, kA, kB), a_from_b);
  for (std::uint32_t i = 0; i < 3; ++i) {
    EXPECT_EQ(graph.map_from_node[first_left + i], before.map_from_node[first_left + i]);
    ExpectSame(Between(graph, first_moved, first_moved + i),
               Between(before, first_moved, first_moved + i));
  }
  EXPECT_EQ(graph.points_in_map[first_left / 3], before.points_in_map[first_left / 3]);
  EXPECT_LT((PointFrom(graph, first_moved, first_moved / 3) -
             PointFrom(before, first_moved, first_moved / 3))
                .norm(),
            1e-9);
}

TEST(ComponentJoinTest, TheSecondComponentIsMovedAsOnePiece) {
  const Pose2 a_from_b{5.0, -1.0, 2.0};
  PoseGraph graph = TwoComponents();
  graph.fixed = {true};
  JoinComponents(kA, kB, a_from_b, graph);
  ExpectJoined(graph, a_from_b, 3);
}

TEST(ComponentJoinTest, TheFirstIsMovedWhereTheSecondIsTiedToTheMap) {
  const Pose2 a_from_b{5.0, -1.0, 2.0};
  for (int tie = 0; tie < 4; ++tie) {
    PoseGraph graph = TwoComponents();
    graph.fixed.resize(6, false);
    graph.fixed[5] = tie == 0;
    graph.fixed_points = {false, tie == 1};
    graph.pose_priors.resize(tie == 2 ? 1 : 0, {3});
    graph.position_priors.resize(tie == 3 ? 1 : 0, {3});
    JoinComponents(kA, kB, a_from_b, graph);
    ExpectJoined(graph, a_from_b, 0);
  }
}

TEST(ComponentJoinTest, NothingMovesWhereBothAreTiedOrAreOne) {
  PoseGraph tied = TwoComponents();
  tied.fixed = {true, false, false, true};
  JoinComponents(kA, kB, Pose2{5.0, -1.0, 2.0}, tied);
  EXPECT_EQ(tied.map_from_node, TwoComponents().map_from_node);
  PoseGraph one = TwoComponents();
  JoinComponents(0, 2, Pose2{5.0, -1.0, 2.0}, one);
  EXPECT_EQ(one.map_from_node, TwoComponents().map_from_node);
}

}  // namespace
}  // namespace loci
