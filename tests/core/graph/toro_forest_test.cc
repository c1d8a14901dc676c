// SPDX-License-Identifier: Apache-2.0
// The growing tree against the one of a batch, and against what it must not move.
#include "core/graph/toro_forest.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/core/graph/random_graph.h"

namespace loci {
namespace {

double Distance(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() + std::abs(WrapAngle(a.theta - b.theta));
}

double LargestDistance(const std::vector<Pose2>& a, const std::vector<Pose2>& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    largest = std::max(largest, Distance(a[i], b[i]));
  }
  return largest;
}

GraphConstraint RandomConstraint(std::uint32_t from, std::uint32_t to, RandomSequence& random) {
  return {from, to, RandomPose(random, 2.0, kPi), RandomInformation(random), false};
}

// Every node after the first joined to an earlier one, and as many loops again.
PoseGraph RandomConnectedGraph(std::uint64_t seed, std::uint32_t node_count) {
  RandomSequence random(seed);
  PoseGraph graph;
  for (std::uint32_t i = 0; i < node_count; ++i) {
    graph.map_from_node.push_back(RandomPose(random, 10.0, kPi));
  }
  for (std::uint32_t i = 1; i < node_count; ++i) {
    const std::uint32_t near =
        i - 1 - static_cast<std::uint32_t>(random.NextBits() % std::min(i, 3U));
    graph.constraints.push_back(RandomConstraint(near, i, random));
    const auto any = static_cast<std::uint32_t>(random.NextBits() % i);
    graph.constraints.push_back(RandomConstraint(i, any, random));
  }
  return graph;
}

// What the lists and sums of the forest must be, found from the paths alone.
void ExpectConsistent(const ToroForest& forest) {
  std::vector<std::vector<std::uint32_t>> through(forest.nodes().size());
  ToroPath path;
  for (std::uint32_t i = 0; i < forest.edges().size(); ++i) {
    forest.FindPath(forest.edges()[i].ends, path);
    for (const std::vector<std::uint32_t>* half : {&path.from_half, &path.to_half}) {
      for (const std::uint32_t node : *half) {
        if (!forest.nodes()[node].IsRoot()) {
          through[node].push_back(i);
        }
      }
    }
  }
  for (std::size_t i = 0; i < through.size(); ++i) {
    const ToroForest::Node& node = forest.nodes()[i];
    std::vector<std::uint32_t> listed = node.through;
    std::sort(listed.begin(), listed.end());
    ASSERT_EQ(listed, through[i]) << "node " << i;
    double rotation = 0.0;
    for (const std::uint32_t edge : node.through) {
      rotation += forest.edges()[edge].weights.rotation;
    }
    EXPECT_EQ(node.stiffness.rotation, rotation);
    EXPECT_EQ(node.depth, node.IsRoot() ? 0 : forest.nodes()[node.parent].depth + 1);
  }
}

TEST(ToroForestTest, StaysABreadthFirstTreeWhileItGrows) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const PoseGraph graph = RandomConnectedGraph(seed, 60);
    ToroForest forest((PoseGraph()));
    PoseGraph prefix;
    for (std::uint32_t i = 0; i < graph.map_from_node.size(); ++i) {
      forest.AddNode(graph.map_from_node[i], false);
      prefix.map_from_node.push_back(graph.map_from_node[i]);
      for (const GraphConstraint& constraint : graph.constraints) {
        if (std::max(constraint.from, constraint.to) == i) {
          forest.AddEdge(constraint);
          prefix.constraints.push_back(constraint);
        }
      }
      const ToroTree batch = BreadthFirstTree(prefix);
      for (std::size_t k = 0; k <= i; ++k) {
        ASSERT_EQ(forest.nodes()[k].depth, batch.depth[k]) << "node " << k << " of " << i + 1;
      }
      ExpectConsistent(forest);
    }
  }
}

TEST(ToroForestTest, ALoopMovesNothing) {
  const PoseGraph graph = RandomConnectedGraph(7, 80);
  ToroForest forest((PoseGraph()));
  for (std::uint32_t i = 0; i < graph.map_from_node.size(); ++i) {
    forest.AddNode(graph.map_from_node[i], i == 0);
    for (const GraphConstraint& constraint : graph.constraints) {
      if (std::max(constraint.from, constraint.to) == i) {
        const std::vector<Pose2> before = forest.Poses();
        if (forest.AddEdge(constraint)) {
          EXPECT_LT(LargestDistance(forest.Poses(), before), 1e-9);
        }
      }
    }
  }
}

TEST(ToroForestTest, TheFirstConstraintOfANodePlacesItInBothDirections) {
  RandomSequence random(8);
  ToroForest forest((PoseGraph()));
  const Pose2 root = RandomPose(random, 5.0, kPi);
  forest.AddNode(root, true);
  forest.AddNode(Pose2{}, false);
  forest.AddNode(Pose2{}, false);
  const GraphConstraint out = RandomConstraint(0, 1, random);
  const GraphConstraint in = RandomConstraint(2, 1, random);
  EXPECT_FALSE(forest.AddEdge(out));
  EXPECT_FALSE(forest.AddEdge(in));
  const std::vector<Pose2> poses = forest.Poses();
  EXPECT_LT(Distance(poses[1], root * out.from_from_to), 1e-12);
  EXPECT_LT(Distance(poses[2] * in.from_from_to, poses[1]), 1e-12);
}

TEST(ToroForestTest, JoiningTwoTreesMovesTheLaterOneAsAWhole) {
  RandomSequence random(9);
  PoseGraph graph;
  for (int i = 0; i < 6; ++i) {
    graph.map_from_node.push_back(RandomPose(random, 5.0, kPi));
  }
  graph.constraints = {RandomConstraint(0, 1, random),
                       RandomConstraint(1, 2, random),
                       RandomConstraint(3, 4, random),
                       RandomConstraint(4, 5, random)};
  ToroForest forest(graph);
  const GraphConstraint join = RandomConstraint(5, 1, random);
  EXPECT_FALSE(forest.AddEdge(join));
  const std::vector<Pose2> poses = forest.Poses();
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LT(Distance(poses[i], graph.map_from_node[i]), 1e-12);
  }
  EXPECT_LT(Distance(poses[5] * join.from_from_to, poses[1]), 1e-9);
  EXPECT_LT(Distance(Inverse(poses[3]) * poses[5],
                     Inverse(graph.map_from_node[3]) * graph.map_from_node[5]),
            1e-9);
  ExpectConsistent(forest);
}

TEST(ToroForestTest, TwoFixedTreesStayWhereTheyAre) {
  RandomSequence random(10);
  PoseGraph graph;
  for (int i = 0; i < 8; ++i) {
    graph.map_from_node.push_back(RandomPose(random, 5.0, kPi));
  }
  graph.fixed = {true, false, false, false, true, false, false, false};
  for (std::uint32_t i = 0; i < 7; ++i) {
    if (i != 3) {
      graph.constraints.push_back(RandomConstraint(i, i + 1, random));
    }
  }
  ToroForest forest(graph);
  EXPECT_TRUE(forest.AddEdge(RandomConstraint(3, 4, random)));
  EXPECT_LT(LargestDistance(forest.Poses(), graph.map_from_node), 1e-9);
  EXPECT_EQ(forest.nodes()[3].depth, 1U);  // nearer to the second root now
  ExpectConsistent(forest);
}

}  // namespace
}  // namespace loci
