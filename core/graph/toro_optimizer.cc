// SPDX-License-Identifier: Apache-2.0
// Spreading of errors along tree paths.
//
// A constraint's path P runs from `from` up to the top, where it meets the path from `to`. With the
// poses of all nodes expressed in their parents' frames (RSS 2007, tree parameterisation), the
// error depends on the nodes of P only. It is spread over them in inverse proportion to their
// stiffness, the diagonal of the Hessian's approximation that preconditions the descent: the
// rotation first, then what remains of the translation (T-ITS 2009 does so in three dimensions;
// moving subtrees rigidly, in the plane too, needs far fewer sweeps than the linearised update of
// RSS 2007). The papers weigh by the full information; here a translation has one weight, the mean
// of both directions, which turning the frame does not change.
#include "core/graph/toro_optimizer.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "core/base/check.h"

namespace loci {
namespace {

// A learning rate below this moves nothing worth the work: the constraint rests.
constexpr double kRateMin = 1e-3;
// Stiffness that a zero information is taken for, so that shares stay finite.
constexpr double kStiffnessMin = 1e-12;

}  // namespace

ToroOptimizer::ToroOptimizer(const PoseGraph& graph) {
  graph_.constraints = graph.constraints;
  graph_.fixed = graph.fixed;
  for (const GraphConstraint& constraint : graph_.constraints) {
    AddEdge(constraint);
  }
  Rebuild(graph.map_from_node);
}

void ToroOptimizer::AddEdge(const GraphConstraint& constraint) {
  Edge edge;
  edge.from = constraint.from;
  edge.to = constraint.to;
  edge.from_from_to = constraint.from_from_to;
  edge.rotation_weight = constraint.information(2, 2);
  edge.translation_weight = 0.5 * (constraint.information(0, 0) + constraint.information(1, 1));
  edges_.push_back(edge);
}

void ToroOptimizer::Rebuild(const std::vector<Pose2>& map_from_node) {
  graph_.map_from_node = map_from_node;
  const ToroTree tree = BreadthFirstTree(graph_);
  nodes_.assign(map_from_node.size(), Node{});
  for (const std::uint32_t i : tree.order) {
    const std::uint32_t parent = tree.parent[i];
    if (parent == ToroTree::kNone) {
      nodes_[i].parent_from_node = map_from_node[i];
    } else {
      HangNode(i, parent, Inverse(map_from_node[parent]) * map_from_node[i]);
    }
  }
  for (std::uint32_t edge = 0; edge < edges_.size(); ++edge) {
    nodes_[edges_[edge].from].joined = true;
    nodes_[edges_[edge].to].joined = true;
    AddToPath(edge);
  }
}

void ToroOptimizer::HangNode(std::uint32_t node,
                             std::uint32_t parent,
                             const Pose2& parent_from_node) {
  nodes_[node].parent = parent;
  nodes_[node].depth = nodes_[parent].depth + 1;
  nodes_[node].parent_from_node = parent_from_node;
}

std::uint32_t ToroOptimizer::AddNode(const Pose2& map_from_node, bool fixed) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  nodes_.back().parent_from_node = map_from_node;
  graph_.map_from_node.push_back(map_from_node);
  graph_.fixed.resize(nodes_.size());
  graph_.fixed.back() = fixed;
  return index;
}

void ToroOptimizer::AddConstraint(const GraphConstraint& constraint) {
  LOCI_CHECK(constraint.from < nodes_.size() && constraint.to < nodes_.size());
  LOCI_CHECK(constraint.from != constraint.to);
  const auto is_alone = [this](std::uint32_t node) {
    return !nodes_[node].joined && !graph_.IsFixed(node);
  };
  const bool from_is_alone = is_alone(constraint.from);
  const bool to_is_alone = is_alone(constraint.to);
  nodes_[constraint.from].joined = true;
  nodes_[constraint.to].joined = true;
  const auto index = static_cast<std::uint32_t>(edges_.size());
  graph_.constraints.push_back(constraint);
  AddEdge(constraint);
  // Of two lone nodes the earlier one becomes the root, as a batch would have it.
  if (to_is_alone && !(from_is_alone && constraint.to < constraint.from)) {
    HangNode(constraint.to, constraint.from, constraint.from_from_to);
    AddToPath(index);
  } else if (from_is_alone) {
    HangNode(constraint.from, constraint.to, Inverse(constraint.from_from_to));
    AddToPath(index);
  } else if (RootOf(constraint.from) != RootOf(constraint.to)) {
    JoinComponents(index);
  } else {
    AddToPath(index);
    RaiseRates(index);
  }
}

// Between two fixed roots there is nothing to move as a whole: the error goes to the nodes between.
void ToroOptimizer::JoinComponents(std::uint32_t edge_index) {
  const Edge& edge = edges_[edge_index];
  const std::uint32_t from_root = RootOf(edge.from);
  const std::uint32_t to_root = RootOf(edge.to);
  std::vector<Pose2> poses = Poses();
  const bool from_stays = graph_.IsFixed(from_root);
  const bool to_stays = graph_.IsFixed(to_root);
  if (!from_stays || !to_stays) {
    const bool move_to = !to_stays && (from_stays || from_root < to_root);
    const Pose2 map_from_end = move_to ? poses[edge.from] * edge.from_from_to
                                       : poses[edge.to] * Inverse(edge.from_from_to);
    const Pose2 new_from_old = map_from_end * Inverse(poses[move_to ? edge.to : edge.from]);
    const std::uint32_t moving_root = move_to ? to_root : from_root;
    for (std::uint32_t i = 0; i < poses.size(); ++i) {
      if (RootOf(i) == moving_root) {
        poses[i] = new_from_old * poses[i];
      }
    }
  }
  Rebuild(poses);
  RaiseRates(edge_index);
}

std::uint32_t ToroOptimizer::RootOf(std::uint32_t node) const {
  while (nodes_[node].parent != ToroTree::kNone) {
    node = nodes_[node].parent;
  }
  return node;
}

// Fills path_from_ and path_to_. Where the ends hang below two fixed roots, the top is the map.
void ToroOptimizer::FindPath(const Edge& edge) {
  path_from_.clear();
  path_to_.clear();
  std::uint32_t a = edge.from;
  std::uint32_t b = edge.to;
  while (a != b) {
    const bool a_is_root = nodes_[a].parent == ToroTree::kNone;
    const bool b_is_root = nodes_[b].parent == ToroTree::kNone;
    if (a_is_root && b_is_root) {
      break;
    }
    if (b_is_root || (!a_is_root && nodes_[a].depth >= nodes_[b].depth)) {
      path_from_.push_back(a);
      a = nodes_[a].parent;
    } else {
      path_to_.push_back(b);
      b = nodes_[b].parent;
    }
  }
  std::reverse(path_from_.begin(), path_from_.end());
  std::reverse(path_to_.begin(), path_to_.end());
}

void ToroOptimizer::AddToPath(std::uint32_t edge_index) {
  Edge& edge = edges_[edge_index];
  FindPath(edge);
  edge.top_depth = !path_from_.empty() ? nodes_[path_from_.front()].depth - 1
                   : !path_to_.empty() ? nodes_[path_to_.front()].depth - 1
                                       : 0;
  for (const std::vector<std::uint32_t>* path : {&path_from_, &path_to_}) {
    for (const std::uint32_t node : *path) {
      nodes_[node].rotation_stiffness += edge.rotation_weight;
      nodes_[node].translation_stiffness += edge.translation_weight;
      nodes_[node].constraints.push_back(edge_index);
    }
  }
  order_is_stale_ = true;
}

// The new constraint must win as much as its information says against what is on its path already
// (ICRA 2008, adaptive learning rates): its rate, and that of every constraint that shares a node
// with it, becomes at least that part.
void ToroOptimizer::RaiseRates(std::uint32_t edge_index) {
  FindPath(edges_[edge_index]);
  const double compliance = PathCompliance(&Node::translation_stiffness);
  const double strength = edges_[edge_index].translation_weight * compliance;
  const double rate = strength / (1.0 + strength);
  edges_[edge_index].rate = 1.0;
  for (const std::vector<std::uint32_t>* path : {&path_from_, &path_to_}) {
    for (const std::uint32_t node : *path) {
      for (const std::uint32_t other : nodes_[node].constraints) {
        edges_[other].rate = std::max(edges_[other].rate, rate);
      }
    }
  }
}

std::size_t ToroOptimizer::Sweep() {
  if (order_is_stale_) {
    // Those nearest to the root first (RSS 2007): what they move, they move as a whole.
    order_.resize(edges_.size());
    std::iota(order_.begin(), order_.end(), 0U);
    std::sort(order_.begin(), order_.end(), [this](std::uint32_t a, std::uint32_t b) {
      return std::make_pair(edges_[a].top_depth, a) < std::make_pair(edges_[b].top_depth, b);
    });
    order_is_stale_ = false;
  }
  std::size_t active = 0;
  for (const std::uint32_t index : order_) {
    Edge& edge = edges_[index];
    if (edge.rate < kRateMin) {
      continue;
    }
    ++active;
    FindPath(edge);
    SpreadRotation(edge);
    SpreadTranslation(edge);
    edge.rate /= 1.0 + edge.rate;  // 1, 1/2, 1/3, ...
  }
  return active;
}

// Sum of 1 / stiffness over the path.
double ToroOptimizer::PathCompliance(double Node::*stiffness) const {
  double sum = 0.0;
  for (const std::vector<std::uint32_t>* path : {&path_from_, &path_to_}) {
    for (const std::uint32_t node : *path) {
      sum += 1.0 / std::max(kStiffnessMin, nodes_[node].*stiffness);
    }
  }
  return sum;
}

// The pose of the path's last node in the frame of its top (in the map, where that is the top).
Pose2 ToroOptimizer::PoseAtTop(const std::vector<std::uint32_t>& path, std::uint32_t end) const {
  const std::uint32_t top = path.empty() ? end : nodes_[path.front()].parent;
  Pose2 pose;
  if (nodes_[top].parent == ToroTree::kNone) {
    pose = nodes_[top].parent_from_node;
  }
  for (const std::uint32_t node : path) {
    pose = pose * nodes_[node].parent_from_node;
  }
  return pose;
}

void ToroOptimizer::SpreadRotation(const Edge& edge) {
  const double compliance = PathCompliance(&Node::rotation_stiffness);
  if (compliance == 0.0) {
    return;
  }
  const double error = WrapAngle(PoseAtTop(path_from_, edge.from).theta + edge.from_from_to.theta -
                                 PoseAtTop(path_to_, edge.to).theta);
  // One constraint against springs in a row would be met by w c / (1 + w c) of the error; the first
  // sweeps take more, since the stiffness holds the constraint itself too.
  const double part = std::min(1.0, edge.rate * edge.rotation_weight * compliance);
  const double per_compliance = part * error / compliance;
  const auto turn = [&](std::uint32_t index, double sign) {
    Node& node = nodes_[index];
    const double share = per_compliance / std::max(kStiffnessMin, node.rotation_stiffness);
    node.parent_from_node.theta = WrapAngle(node.parent_from_node.theta + sign * share);
  };
  for (const std::uint32_t node : path_from_) {
    turn(node, -1.0);
  }
  for (const std::uint32_t node : path_to_) {
    turn(node, 1.0);
  }
}

void ToroOptimizer::SpreadTranslation(const Edge& edge) {
  const double compliance = PathCompliance(&Node::translation_stiffness);
  if (compliance == 0.0) {
    return;
  }
  const Pose2 top_from_from = PoseAtTop(path_from_, edge.from);
  const Pose2 top_from_to = PoseAtTop(path_to_, edge.to);
  const Eigen::Vector2d error =
      top_from_from * edge.from_from_to.translation() - top_from_to.translation();
  const double part = std::min(1.0, edge.rate * edge.translation_weight * compliance);
  const Eigen::Vector2d per_compliance = part / compliance * error;
  ShiftPath(path_from_, edge.from, -per_compliance);
  ShiftPath(path_to_, edge.to, per_compliance);
}

// Shifts each node of the path against its parent by its share, given in the frame of the top.
void ToroOptimizer::ShiftPath(const std::vector<std::uint32_t>& path,
                              std::uint32_t end,
                              const Eigen::Vector2d& per_compliance) {
  double top_from_parent_rad =
      PoseAtTop({}, path.empty() ? end : nodes_[path.front()].parent).theta;
  for (const std::uint32_t index : path) {
    Node& node = nodes_[index];
    const double share = 1.0 / std::max(kStiffnessMin, node.translation_stiffness);
    const Eigen::Vector2d shift =
        Pose2{0.0, 0.0, -top_from_parent_rad} * (share * per_compliance).eval();
    node.parent_from_node.x += shift.x();
    node.parent_from_node.y += shift.y();
    top_from_parent_rad += node.parent_from_node.theta;
  }
}

std::vector<Pose2> ToroOptimizer::Poses() const {
  std::vector<Pose2> poses(nodes_.size());
  std::vector<bool> known(nodes_.size());
  std::vector<std::uint32_t> pending;
  for (std::uint32_t i = 0; i < nodes_.size(); ++i) {
    std::uint32_t node = i;
    while (node != ToroTree::kNone && !known[node]) {
      pending.push_back(node);
      node = nodes_[node].parent;
    }
    for (; !pending.empty(); pending.pop_back()) {
      node = pending.back();
      const std::uint32_t parent = nodes_[node].parent;
      poses[node] = parent == ToroTree::kNone ? nodes_[node].parent_from_node
                                              : poses[parent] * nodes_[node].parent_from_node;
      known[node] = true;
    }
  }
  return poses;
}

}  // namespace loci
