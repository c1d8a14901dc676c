// SPDX-License-Identifier: Apache-2.0
// Breadth-first spanning tree.
#include "core/graph/toro_tree.h"

#include <cstddef>
#include <utility>

#include "core/graph/joint_constraint.h"

namespace loci {
namespace {

// Constraints of each node, in the order of their index, as one array with offsets.
struct Neighbourhood {
  std::vector<std::size_t> begin;  // of node i in `constraint`; one more than there are nodes
  std::vector<std::uint32_t> constraint;
};

Neighbourhood FindNeighbourhood(std::size_t node_count, std::span<const NodePair> constraints) {
  Neighbourhood result;
  result.begin.assign(node_count + 1, 0);
  for (const NodePair& constraint : constraints) {
    ++result.begin[constraint.from + 1];
    ++result.begin[constraint.to + 1];
  }
  for (std::size_t i = 1; i < result.begin.size(); ++i) {
    result.begin[i] += result.begin[i - 1];
  }
  result.constraint.resize(result.begin.back());
  std::vector<std::size_t> next(result.begin.begin(), result.begin.end() - 1);
  for (std::uint32_t i = 0; i < constraints.size(); ++i) {
    result.constraint[next[constraints[i].from]++] = i;
    result.constraint[next[constraints[i].to]++] = i;
  }
  return result;
}

}  // namespace

ToroTree BreadthFirstTree(const PoseGraph& graph) {
  std::vector<NodePair> pairs;
  pairs.reserve(graph.constraints.size());
  for (const GraphConstraint& constraint : graph.constraints) {
    pairs.push_back({constraint.from, constraint.to});
  }
  for (const JointConstraint& constraint : graph.joint_constraints) {
    for (std::size_t i = 1; i < constraint.nodes.size(); ++i) {
      pairs.push_back({constraint.nodes.front(), constraint.nodes[i]});
    }
  }
  return BreadthFirstTree(HeldNodes(graph), pairs);
}

ToroTree BreadthFirstTree(const std::vector<bool>& is_root, std::span<const NodePair> constraints) {
  const std::size_t node_count = is_root.size();
  const Neighbourhood neighbourhood = FindNeighbourhood(node_count, constraints);
  ToroTree tree;
  tree.parent.assign(node_count, ToroTree::kNone);
  tree.parent_constraint.assign(node_count, ToroTree::kNone);
  tree.depth.assign(node_count, 0);
  tree.order.reserve(node_count);
  std::vector<bool> reached = is_root;
  // A component that hangs together by points alone has no held node of its own tree: its nodes are
  // taken as roots when the search has come to an end without them.
  for (std::uint32_t i = 0; i < node_count; ++i) {
    if (reached[i]) {
      tree.order.push_back(i);
    }
  }
  std::size_t next = 0;
  for (std::uint32_t first_unreached = 0;; ++first_unreached) {
    for (; next < tree.order.size(); ++next) {
      const std::uint32_t node = tree.order[next];
      for (std::size_t k = neighbourhood.begin[node]; k < neighbourhood.begin[node + 1]; ++k) {
        const std::uint32_t index = neighbourhood.constraint[k];
        const NodePair& constraint = constraints[index];
        const std::uint32_t other = constraint.from == node ? constraint.to : constraint.from;
        if (!reached[other]) {
          reached[other] = true;
          tree.parent[other] = node;
          tree.parent_constraint[other] = index;
          tree.depth[other] = tree.depth[node] + 1;
          tree.order.push_back(other);
        }
      }
    }
    while (first_unreached < node_count && reached[first_unreached]) {
      ++first_unreached;
    }
    if (first_unreached == node_count) {
      return tree;
    }
    reached[first_unreached] = true;
    tree.order.push_back(first_unreached);
  }
}

void PlaceByTree(const ToroTree& tree, PoseGraph& graph) {
  if (!graph.joint_constraints.empty()) {
    PoseGraph pairs = WithImpliedPairs(graph);
    PlaceByTree(tree, pairs);
    graph.map_from_node = std::move(pairs.map_from_node);
    graph.points_in_map = std::move(pairs.points_in_map);
    return;
  }
  for (const std::uint32_t node : tree.order) {
    if (tree.parent[node] == ToroTree::kNone) {
      continue;
    }
    const GraphConstraint& constraint = graph.constraints[tree.parent_constraint[node]];
    const Pose2 parent_from_node =
        constraint.to == node ? constraint.from_from_to : Inverse(constraint.from_from_to);
    graph.map_from_node[node] = graph.map_from_node[tree.parent[node]] * parent_from_node;
  }
  PlacePoints(graph);
}

void PlacePoints(PoseGraph& graph) {
  std::vector<bool> placed = graph.fixed_points;
  placed.resize(graph.points_in_map.size());
  for (const PointConstraint& constraint : graph.point_constraints) {
    if (!placed[constraint.point]) {
      placed[constraint.point] = true;
      graph.points_in_map[constraint.point] =
          graph.map_from_node[constraint.from] * constraint.point_in_from;
    }
  }
}

}  // namespace loci
