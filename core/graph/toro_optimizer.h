// SPDX-License-Identifier: Apache-2.0
// Stochastic gradient descent on a tree parameterisation of the pose graph (TORO).
//
// After G. Grisetti, C. Stachniss, S. Grzonka, W. Burgard: "A Tree Parameterization for Efficiently
// Computing Maximum Likelihood Maps using Gradient Descent" (RSS 2007); G. Grisetti, D. Lodi
// Rizzini, C. Stachniss, E. Olson, W. Burgard: "Online Constraint Network Optimization for
// Efficient Maximum Likelihood Map Learning" (ICRA 2008); G. Grisetti, C. Stachniss, W. Burgard:
// "Nonlinear Constraint Network Optimization for Efficient Map Learning" (T-ITS 2009).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/graph/pose_graph.h"
#include "core/graph/toro_tree.h"

namespace loci {

// Robust against a bad start and cheap per sweep, but not exact: finish with OptimizeSparse.
//
// Batch: construct from a graph, Sweep() some times. Incremental: AddNode and AddConstraint between
// sweeps; only constraints near the new ones regain a learning rate and are worked on, so that the
// rest does not spring open. Deterministic. Point constraints take no part.
class ToroOptimizer {
 public:
  // Starts at the graph's poses, every constraint at its full learning rate. The graph must be
  // valid.
  explicit ToroOptimizer(const PoseGraph& graph);

  // A new node. It stays alone until a constraint joins it to the rest.
  std::uint32_t AddNode(const Pose2& map_from_node, bool fixed);

  // A new constraint, which must be valid. The first one of a new node hangs it into the tree, at
  // the pose that the constraint says. One that joins two components moves the later one as a
  // whole. Every other one raises the learning rates of those whose paths share a node with its
  // path.
  void AddConstraint(const GraphConstraint& constraint);

  // One pass over the constraints that still have a learning rate; returns how many they were.
  std::size_t Sweep();

  // Poses of all nodes, composed from the roots.
  std::vector<Pose2> Poses() const;

 private:
  // A node hangs below its parent; what a constraint spreads over the tree, it spreads over the
  // poses of the nodes on its path in their parents' frames.
  struct Node {
    Pose2 parent_from_node;  // map_from_node for roots
    std::uint32_t parent = ToroTree::kNone;
    std::uint32_t depth = 0;
    bool joined = false;                 // some constraint names it
    double rotation_stiffness = 0.0;     // sum of the weights of all constraints whose path is here
    double translation_stiffness = 0.0;  // the same, of translations
    std::vector<std::uint32_t> constraints;  // those
  };
  struct Edge {
    std::uint32_t from = 0;
    std::uint32_t to = 0;
    Pose2 from_from_to;
    double rotation_weight = 0.0;     // 1 / rad^2
    double translation_weight = 0.0;  // 1 / m^2, the mean of both directions
    double rate = 1.0;
    std::uint32_t top_depth = 0;  // of the node where both halves of its path meet
  };

  void AddEdge(const GraphConstraint& constraint);
  void Rebuild(const std::vector<Pose2>& map_from_node);
  void HangNode(std::uint32_t node, std::uint32_t parent, const Pose2& parent_from_node);
  void JoinComponents(std::uint32_t edge);
  void AddToPath(std::uint32_t edge);
  void RaiseRates(std::uint32_t edge);
  std::uint32_t RootOf(std::uint32_t node) const;
  void FindPath(const Edge& edge);
  double PathCompliance(double Node::*stiffness) const;
  void SpreadRotation(const Edge& edge);
  void SpreadTranslation(const Edge& edge);
  Pose2 PoseAtTop(const std::vector<std::uint32_t>& path, std::uint32_t end) const;
  void ShiftPath(const std::vector<std::uint32_t>& path,
                 std::uint32_t end,
                 const Eigen::Vector2d& per_compliance);

  PoseGraph graph_;  // its poses are those of the last Rebuild
  std::vector<Node> nodes_;
  std::vector<Edge> edges_;
  std::vector<std::uint32_t> order_;  // of the edges in a sweep
  bool order_is_stale_ = true;
  // The two halves of the path at hand, each from below the top down to `from` and to `to`.
  std::vector<std::uint32_t> path_from_;
  std::vector<std::uint32_t> path_to_;
};

}  // namespace loci
