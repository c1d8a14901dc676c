// SPDX-License-Identifier: Apache-2.0
// Stochastic gradient descent on a tree parameterisation of the pose graph (TORO).
//
// After G. Grisetti, C. Stachniss, S. Grzonka, W. Burgard: "A Tree Parameterization for Efficiently
// Computing Maximum Likelihood Maps using Gradient Descent" (RSS 2007); G. Grisetti, D. Lodi
// Rizzini, C. Stachniss, E. Olson, W. Burgard: "Online Constraint Network Optimization for
// Efficient Maximum Likelihood Mapping" (ICRA 2008); G. Grisetti, C. Stachniss, W. Burgard:
// "Nonlinear Constraint Network Optimization for Efficient Map Learning" (T-ITS 2009).
#pragma once

#include <cstdint>
#include <vector>

#include "core/graph/pose_graph.h"
#include "core/graph/toro_tree.h"

namespace loci {

// Robust against a bad start and cheap per sweep, but not exact: finish with OptimizeSparse.
//
// Batch: construct from a graph, Sweep() some times. Incremental: AddNode and AddConstraint between
// sweeps; only constraints near the new ones regain a learning rate and are worked on.
class ToroOptimizer {
 public:
  // Starts at the graph's poses, every constraint at its full learning rate. Point constraints take
  // no part. The graph must be valid.
  explicit ToroOptimizer(const PoseGraph& graph);

  // A new node, a root until a constraint joins it to the rest.
  std::uint32_t AddNode(const Pose2& map_from_node, bool fixed);

  // The first constraint of a new node hangs it into the tree, at the pose that the constraint
  // says; every other one raises the learning rates around its path.
  void AddConstraint(const GraphConstraint& constraint);

  // One pass over the constraints that still have a learning rate; returns how many they were.
  int Sweep();

  // Poses of all nodes, composed from the roots.
  std::vector<Pose2> Poses() const;

 private:
  // A node's pose in its parent's frame (in the map for roots).
  struct Node {
    Pose2 parent_from_node;
    double rotation_weight = 0.0;     // sum over the constraints whose path goes through this node
    double translation_weight = 0.0;  // the same; 1 / m^2
    bool held = false;
  };
};

}  // namespace loci
