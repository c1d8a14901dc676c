// SPDX-License-Identifier: Apache-2.0
// A growing pose graph in the parameters of its spanning tree.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/geometry/se2.h"
#include "core/graph/pose_graph.h"
#include "core/graph/toro_paths.h"
#include "core/graph/toro_tree.h"

namespace loci {

// Nodes hang below each other; each keeps its pose in its parent's frame, so that moving a node
// carries all below it along. A constraint between two nodes depends on the nodes of its path
// alone: from one end up to the top, where both ends' ways to the root meet, and down to the other.
//
// Invariant: no constraint joins nodes whose depths differ by more than one, so that
// every tree is a breadth-first one, its paths are short, and few constraints share a node (RSS
// 2007, section IV, chooses the tree in the same way; ICRA 2008 keeps it while the graph grows).
// Changing the tree moves nothing in the map.
class ToroForest {
 public:
  struct Edge {
    NodePair ends;
    Pose2 from_from_to;
    ToroWeights weights;
  };
  struct Node {
    Pose2 parent_from_node;  // map_from_node for roots
    std::uint32_t parent = ToroTree::kNone;
    std::uint32_t depth = 0;
    bool fixed = false;
    ToroWeights stiffness;                // of the edges through the node
    std::vector<std::uint32_t> incident;  // edges that name the node
    std::vector<std::uint32_t> through;   // edges whose path holds the node; none for roots

    bool IsRoot() const { return parent == ToroTree::kNone; }
  };

  // All nodes and pose constraints of a valid graph, at its poses; of a joint constraint its
  // implied pairs (joint_constraint.h).
  explicit ToroForest(const PoseGraph& graph);

  // A new node, which is a root until an edge joins it to another.
  std::uint32_t AddNode(const Pose2& map_from_node, bool fixed);

  // A new edge, with the index edges().size() - 1. A node without an edge before now hangs where
  // the constraint says; of two trees the later one is moved as a whole, unless both roots are
  // fixed. Returns true if neither was so: the edge closes a loop, and nothing has moved in the
  // map.
  bool AddEdge(const GraphConstraint& constraint);

  const std::vector<Node>& nodes() const { return nodes_; }
  const std::vector<Edge>& edges() const { return edges_; }
  void SetPose(std::uint32_t node, const Pose2& parent_from_node) {
    nodes_[node].parent_from_node = parent_from_node;
  }

  // Overwrites `path`, whose memory is used again.
  void FindPath(const NodePair& ends, ToroPath& path) const;

  // Nodes so that every parent stands before its children: by depth, then by index.
  std::vector<std::uint32_t> TreeOrder() const;

  // Poses of all nodes, composed from the roots.
  std::vector<Pose2> Poses() const;

 private:
  // A node that comes nearer to its root, and its parent and depth then.
  struct Shortening {
    std::uint32_t node = 0;
    std::uint32_t parent = 0;
    std::uint32_t depth = 0;
  };

  void PushEdge(const GraphConstraint& constraint);
  void Rebuild(const std::vector<Pose2>& map_from_node, const std::vector<bool>& is_root);
  void JoinTrees(const Edge& edge, std::uint32_t from_root, std::uint32_t to_root);
  void Hang(std::uint32_t node, std::uint32_t parent, const Pose2& parent_from_node);
  void ShortenPaths(const Edge& edge);
  void Rehang(const std::vector<Shortening>& shortenings);
  void Link(std::uint32_t edge);
  void Unlink(const std::vector<std::uint32_t>& edges);  // in ascending order
  std::uint32_t RootOf(std::uint32_t node) const;
  std::uint32_t OtherEnd(std::uint32_t edge, std::uint32_t node) const;
  Pose2 PoseAtTop(const std::vector<std::uint32_t>& half) const;

  std::vector<Node> nodes_;
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> new_depth_;  // kNone for all nodes but those at hand
  ToroPath path_;                         // at hand
};

}  // namespace loci
