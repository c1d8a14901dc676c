// SPDX-License-Identifier: Apache-2.0
// The spanning tree of a pose graph, which parameterises its nodes for gradient descent.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/graph/pose_graph.h"

namespace loci {

// A forest: held nodes are roots, and every other node hangs below the node through which a
// breadth-first search from the roots found it. A pose is the product of the relative poses along
// the path from its root: the tree parameterisation of Grisetti et al. 2007 (section IV).
struct ToroTree {
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  std::vector<std::uint32_t> parent;  // kNone for roots
  std::vector<std::uint32_t> depth;   // 0 for roots
  std::vector<std::uint32_t>
      parent_constraint;             // which joins the node to its parent; kNone for roots
  std::vector<std::uint32_t> order;  // of the search: every parent stands before its children
};

// The nodes that a constraint joins.
struct NodePair {
  std::uint32_t from = 0;
  std::uint32_t to = 0;
};

// The breadth-first tree over the pose constraints of `graph`: roots in the order of their index,
// neighbours in the order of their constraints. Joint constraints are taken for their implied pairs
// (joint_constraint.h), which are numbered after the other constraints.
ToroTree BreadthFirstTree(const PoseGraph& graph);

// The same from nothing but indices. Nodes that no root reaches make their lowest one a root.
ToroTree BreadthFirstTree(const std::vector<bool>& is_root, std::span<const NodePair> constraints);

// The poses that follow from the roots' by composing the constraints along the tree: a start
// without the drift of odometry. Free points are placed by their first constraint.
void PlaceByTree(const ToroTree& tree, PoseGraph& graph);

// Places every free point by its first constraint, from the nodes' present poses.
void PlacePoints(PoseGraph& graph);

}  // namespace loci
