// SPDX-License-Identifier: Apache-2.0
// Stochastic gradient descent on a tree parameterisation of the pose graph (TORO).
//
// After G. Grisetti, C. Stachniss, S. Grzonka, W. Burgard: "A Tree Parameterization for Efficiently
// Computing Maximum Likelihood Maps using Gradient Descent" (RSS 2007); G. Grisetti, D. Lodi
// Rizzini, C. Stachniss, E. Olson, W. Burgard: "Online Constraint Network Optimization for
// Efficient Maximum Likelihood Map Learning" (ICRA 2008); G. Grisetti, C. Stachniss, W. Burgard:
// "Nonlinear Constraint Network Optimization for Efficient Map Learning" (T-ITS 2009).
//
// What is minimised, and the two ways down, stand in toro_patch.h; the tree in toro_forest.h. Here
// is when which constraint is worked on:
//
// A constraint's learning rate lambda says how much of its residual a sweep spreads over its path.
// It starts at 1 and becomes lambda / (1 + lambda) with every sweep: 1, 1/2, 1/3 .., whose sum has
// no bound while that of its squares has, as descent on one constraint after the other needs. Below
// a least rate a constraint rests and costs nothing.
//
// A new constraint that closes a loop gets the rate 1. It must win as much as its information says
// against what is on its path already: with the weight w and the path's compliance c (the sum of 1
// / stiffness) that is w c / (1 + w c), and to that the rates of all constraints that share a node
// with its path are raised (ICRA 2008: adaptive learning rates). All others keep theirs, mostly 0.
// The sweeps of an update close the loop in this way; what they leave behind, Settle smooths, from
// the path outwards, as far as moving a node still gains something. So the work is that of the
// loops around, of which a path near the root has many, and old parts are only moved to where they
// fit better.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/graph/pose_graph.h"
#include "core/graph/toro_forest.h"
#include "core/graph/toro_patch.h"
#include "core/graph/toro_paths.h"

namespace loci {

// Robust against a bad start and cheap per sweep, but not exact: finish with OptimizeSparse.
//
// Batch: construct from a graph, Sweep() some times. Incremental: AddNode and AddConstraint, and
// Update() after each node. Deterministic. No sweep but the first after a change of the graph asks
// for memory.
//
// Fixed nodes keep their poses to the bit, and so does the lowest node of a component without one.
// Priors and point constraints take no part, and robust kernels neither: a component that priors
// tie to the map descends as if it were alone, and the exact finish brings it to them.
class ToroOptimizer {
 public:
  // Starts at the graph's poses, every constraint at its full learning rate. The graph must be
  // valid and sweepable (sweep_limit.h).
  explicit ToroOptimizer(const PoseGraph& graph);

  // A new node. It stays alone until a constraint joins it to the rest.
  std::uint32_t AddNode(const Pose2& map_from_node, bool fixed);

  // A new constraint, which must be valid. The first one of a new node hangs it into the tree, at
  // the pose that the constraint says. One that joins two components moves the later one as a
  // whole. Every other one closes a loop, and raises learning rates.
  void AddConstraint(const GraphConstraint& constraint);

  // One pass over the constraints that still have a learning rate; returns how many they were.
  std::size_t Sweep();

  // A few sweeps over the constraints whose rates were raised, which then rest, and settling of
  // the nodes around. Where no loop was closed it returns at once. Its rounds are bounded: what a
  // large closure leaves to be done, the next updates do. Returns how many nodes wait for them.
  std::size_t Update();

  // Poses of all nodes, composed from the roots.
  std::vector<Pose2> Poses() const { return forest_.Poses(); }

 private:
  static constexpr std::uint32_t kAbsent = ToroTree::kNone;

  void RaiseRates(std::uint32_t edge);
  void Activate(std::uint32_t edge);
  void Rest(double rate_min);
  void BuildSweepPatch();
  void SweepPatch();
  void SettleRound();
  void MarkUnsettled(std::uint32_t node);
  void ClearPatch();
  void AddPatchConstraint(std::uint32_t edge);
  std::uint32_t PatchNode(std::uint32_t node);

  ToroForest forest_;
  std::vector<double> rates_;             // by edge
  std::vector<std::uint32_t> active_;     // edges whose rate is not 0, once each
  std::vector<bool> is_active_;           // by edge
  std::vector<std::uint32_t> unsettled_;  // nodes to settle, once each
  std::vector<bool> is_unsettled_;        // by node

  ToroPatch patch_;
  bool patch_holds_active_ = false;         // as the tree is now
  std::vector<std::uint32_t> patch_index_;  // by node; kAbsent outside the patch
  std::vector<std::uint32_t> patch_nodes_;  // by index in the patch
  // Memory of the functions, used again.
  std::vector<double> patch_rates_;
  std::vector<bool> has_stiffness_;  // by index in the patch
  std::vector<bool> is_in_patch_;    // by edge
  std::vector<std::uint32_t> climbed_;
  std::vector<std::uint32_t> settling_;
  std::vector<std::uint32_t> disturbed_;
  std::vector<std::uint32_t> edges_at_hand_;
  ToroPath path_;
};

}  // namespace loci
