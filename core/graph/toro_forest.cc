// SPDX-License-Identifier: Apache-2.0
// Growing and re-hanging of the tree.
#include "core/graph/toro_forest.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/base/check.h"
#include "core/graph/joint_constraint.h"

namespace loci {

ToroForest::ToroForest(const PoseGraph& graph) {
  nodes_.resize(graph.map_from_node.size());
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    nodes_[i].fixed = graph.IsFixed(i);
  }
  edges_.reserve(graph.constraints.size());
  for (const GraphConstraint& constraint : graph.constraints) {
    PushEdge(constraint);
  }
  for (const JointConstraint& constraint : graph.joint_constraints) {
    for (std::size_t i = 1; i < constraint.nodes.size(); ++i) {
      PushEdge(ImpliedPair(constraint, i));
    }
  }
  Rebuild(graph.map_from_node, HeldNodes(graph));
}

std::uint32_t ToroForest::AddNode(const Pose2& map_from_node, bool fixed) {
  nodes_.emplace_back();
  nodes_.back().parent_from_node = map_from_node;
  nodes_.back().fixed = fixed;
  return static_cast<std::uint32_t>(nodes_.size() - 1);
}

void ToroForest::PushEdge(const GraphConstraint& constraint) {
  LOCI_CHECK(constraint.from < nodes_.size() && constraint.to < nodes_.size());
  LOCI_CHECK(constraint.from != constraint.to);
  const auto index = static_cast<std::uint32_t>(edges_.size());
  Edge& edge = edges_.emplace_back();
  edge.ends = {constraint.from, constraint.to};
  edge.from_from_to = constraint.from_from_to;
  edge.weights = ToroWeightsFrom<2>(constraint.information);
  nodes_[constraint.from].incident.push_back(index);
  nodes_[constraint.to].incident.push_back(index);
}

bool ToroForest::AddEdge(const GraphConstraint& constraint) {
  PushEdge(constraint);
  const auto index = static_cast<std::uint32_t>(edges_.size() - 1);
  const auto is_alone = [this](std::uint32_t node) {
    return nodes_[node].incident.size() == 1 && !nodes_[node].fixed;
  };
  const bool from_is_alone = is_alone(constraint.from);
  const bool to_is_alone = is_alone(constraint.to);
  // Of two lone nodes the earlier one becomes the root, as a batch would have it.
  if (to_is_alone && !(from_is_alone && constraint.to < constraint.from)) {
    Hang(constraint.to, constraint.from, constraint.from_from_to);
    Link(index);
    return false;
  }
  if (from_is_alone) {
    Hang(constraint.from, constraint.to, Inverse(constraint.from_from_to));
    Link(index);
    return false;
  }
  const std::uint32_t from_root = RootOf(constraint.from);
  const std::uint32_t to_root = RootOf(constraint.to);
  if (from_root != to_root && !(nodes_[from_root].fixed && nodes_[to_root].fixed)) {
    JoinTrees(edges_[index], from_root, to_root);
    return false;
  }
  Link(index);
  ShortenPaths(edges_[index]);
  return true;
}

void ToroForest::Rebuild(const std::vector<Pose2>& map_from_node,
                         const std::vector<bool>& is_root) {
  std::vector<NodePair> pairs;
  pairs.reserve(edges_.size());
  for (const Edge& edge : edges_) {
    pairs.push_back(edge.ends);
  }
  const ToroTree tree = BreadthFirstTree(is_root, pairs);
  for (const std::uint32_t i : tree.order) {
    nodes_[i].through.clear();
    nodes_[i].stiffness = {};
    nodes_[i].parent = ToroTree::kNone;
    nodes_[i].depth = 0;
    const std::uint32_t parent = tree.parent[i];
    if (parent == ToroTree::kNone) {
      nodes_[i].parent_from_node = map_from_node[i];
    } else {
      Hang(i, parent, Inverse(map_from_node[parent]) * map_from_node[i]);
    }
  }
  for (std::uint32_t edge = 0; edge < edges_.size(); ++edge) {
    Link(edge);
  }
}

// Costs a new start, but happens once for each tree. A fixed root stays, otherwise the earlier one.
void ToroForest::JoinTrees(const Edge& edge, std::uint32_t from_root, std::uint32_t to_root) {
  std::vector<Pose2> poses = Poses();
  const bool move_to = !nodes_[to_root].fixed && (nodes_[from_root].fixed || from_root < to_root);
  const Pose2 map_from_end = move_to ? poses[edge.ends.from] * edge.from_from_to
                                     : poses[edge.ends.to] * Inverse(edge.from_from_to);
  const Pose2 new_from_old = map_from_end * Inverse(poses[move_to ? edge.ends.to : edge.ends.from]);
  const std::uint32_t moving_root = move_to ? to_root : from_root;
  std::vector<bool> is_root(nodes_.size());
  std::vector<bool> moves(nodes_.size());
  for (const std::uint32_t i : TreeOrder()) {
    is_root[i] = nodes_[i].IsRoot() && i != moving_root;
    moves[i] = nodes_[i].IsRoot() ? i == moving_root : moves[nodes_[i].parent];
    if (moves[i]) {
      poses[i] = new_from_old * poses[i];
    }
  }
  Rebuild(poses, is_root);
}

void ToroForest::Hang(std::uint32_t node, std::uint32_t parent, const Pose2& parent_from_node) {
  nodes_[node].parent = parent;
  nodes_[node].depth = nodes_[parent].depth + 1;
  nodes_[node].parent_from_node = parent_from_node;
}

std::uint32_t ToroForest::RootOf(std::uint32_t node) const {
  while (!nodes_[node].IsRoot()) {
    node = nodes_[node].parent;
  }
  return node;
}

std::uint32_t ToroForest::OtherEnd(std::uint32_t edge, std::uint32_t node) const {
  const NodePair& ends = edges_[edge].ends;
  return ends.from == node ? ends.to : ends.from;
}

void ToroForest::FindPath(const NodePair& ends, ToroPath& path) const {
  FindToroPath(
      ends,
      [this](std::uint32_t node) { return nodes_[node].parent; },
      [this](std::uint32_t node) { return nodes_[node].depth; },
      path);
}

void ToroForest::Link(std::uint32_t edge) {
  FindPath(edges_[edge].ends, path_);
  for (const std::vector<std::uint32_t>* half : {&path_.from_half, &path_.to_half}) {
    for (const std::uint32_t node : *half) {
      if (!nodes_[node].IsRoot()) {
        nodes_[node].through.push_back(edge);
        nodes_[node].stiffness += edges_[edge].weights;
      }
    }
  }
}

// A breadth-first search from the end of the new edge that comes nearer to the root, over all nodes
// that do so with it. Depths only fall, each time by one at least: until the next
// JoinTrees, all calls together look at no more nodes than there are, times the greatest depth.
void ToroForest::ShortenPaths(const Edge& edge) {
  const bool to_is_deeper = nodes_[edge.ends.to].depth > nodes_[edge.ends.from].depth;
  const std::uint32_t upper = to_is_deeper ? edge.ends.from : edge.ends.to;
  const std::uint32_t lower = to_is_deeper ? edge.ends.to : edge.ends.from;
  if (nodes_[lower].depth <= nodes_[upper].depth + 1) {
    return;
  }
  std::vector<Shortening> found = {{lower, upper, nodes_[upper].depth + 1}};
  new_depth_.resize(nodes_.size(), ToroTree::kNone);
  new_depth_[lower] = found.front().depth;
  for (std::size_t next = 0; next < found.size(); ++next) {
    const std::uint32_t node = found[next].node;
    const std::uint32_t depth = found[next].depth + 1;
    for (const std::uint32_t incident : nodes_[node].incident) {
      const std::uint32_t other = OtherEnd(incident, node);
      if (std::min(nodes_[other].depth, new_depth_[other]) > depth) {
        new_depth_[other] = depth;
        found.push_back({other, node, depth});
      }
    }
  }
  // Who comes nearer together with its parent stays with it: its paths remain as they are.
  for (Shortening& each : found) {
    const std::uint32_t parent = nodes_[each.node].parent;
    if (new_depth_[parent] != ToroTree::kNone && new_depth_[parent] + 1 == each.depth) {
      each.parent = parent;
    }
  }
  for (const Shortening& each : found) {
    new_depth_[each.node] = ToroTree::kNone;
  }
  Rehang(found);
}

// All nodes stay where they are in the map. The path of an edge changes only if it holds a node
// whose parent does.
void ToroForest::Rehang(const std::vector<Shortening>& shortenings) {
  std::vector<std::uint32_t> changed_edges;
  std::vector<std::pair<std::uint32_t, Pose2>> changed_poses;
  for (const Shortening& each : shortenings) {
    const Node& node = nodes_[each.node];
    if (node.parent == each.parent) {
      continue;
    }
    changed_edges.insert(changed_edges.end(), node.through.begin(), node.through.end());
    FindPath({each.parent, each.node}, path_);
    changed_poses.emplace_back(each.node,
                               Inverse(PoseAtTop(path_.from_half)) * PoseAtTop(path_.to_half));
  }
  std::sort(changed_edges.begin(), changed_edges.end());
  changed_edges.erase(std::unique(changed_edges.begin(), changed_edges.end()), changed_edges.end());
  Unlink(changed_edges);
  for (const Shortening& each : shortenings) {
    nodes_[each.node].parent = each.parent;
    nodes_[each.node].depth = each.depth;
  }
  for (const auto& [node, parent_from_node] : changed_poses) {
    nodes_[node].parent_from_node = parent_from_node;
  }
  for (const std::uint32_t edge : changed_edges) {
    Link(edge);
  }
}

void ToroForest::Unlink(const std::vector<std::uint32_t>& edges) {
  std::vector<std::uint32_t> left;
  for (const std::uint32_t edge : edges) {
    FindPath(edges_[edge].ends, path_);
    left.insert(left.end(), path_.from_half.begin(), path_.from_half.end());
    left.insert(left.end(), path_.to_half.begin(), path_.to_half.end());
  }
  std::sort(left.begin(), left.end());
  left.erase(std::unique(left.begin(), left.end()), left.end());
  for (const std::uint32_t index : left) {
    Node& node = nodes_[index];
    std::erase_if(node.through, [&](std::uint32_t edge) {
      return std::binary_search(edges.begin(), edges.end(), edge);
    });
    node.stiffness = {};  // summed again: what a subtraction leaves would depend on the past
    for (const std::uint32_t edge : node.through) {
      node.stiffness += edges_[edge].weights;
    }
  }
}

// The pose of a half's end in the frame of the path's top.
Pose2 ToroForest::PoseAtTop(const std::vector<std::uint32_t>& half) const {
  Pose2 pose;
  for (const std::uint32_t node : half) {
    pose = nodes_[node].parent_from_node * pose;
  }
  return pose;
}

std::vector<std::uint32_t> ToroForest::TreeOrder() const {
  std::vector<std::uint32_t> order(nodes_.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(), [this](std::uint32_t a, std::uint32_t b) {
    return nodes_[a].depth < nodes_[b].depth;
  });
  return order;
}

std::vector<Pose2> ToroForest::Poses() const {
  std::vector<Pose2> poses(nodes_.size());
  for (const std::uint32_t node : TreeOrder()) {
    poses[node] = nodes_[node].IsRoot()
                      ? nodes_[node].parent_from_node
                      : poses[nodes_[node].parent] * nodes_[node].parent_from_node;
  }
  return poses;
}

}  // namespace loci
