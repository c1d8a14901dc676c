// SPDX-License-Identifier: Apache-2.0
// Removing nodes from a pose graph, so that it can be bounded by area: what they said of their
// neighbours stays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/status.h"
#include "core/graph/pose_graph.h"
#include "core/graph/robust_kernel.h"

namespace loci {

struct MarginalOptions {
  // Up to so many neighbours the result is exact, and dense: it ties each neighbour to each other
  // one. More neighbours get a tree. Each node that is removed later has the neighbours that this
  // leaves, so that a large number makes the rest of the graph dense. At least 2.
  std::size_t dense_neighbours_max = 4;
  // A robust constraint counts with the weight that the kernel gives it at the present poses.
  RobustKernel kernel;
};

// What takes the place of a node's constraints.
struct NodeMarginal {
  std::vector<GraphConstraint> constraints;
  std::vector<JointConstraint> joint_constraints;
};

// The sum of all constraints of a node, as they are linearised at the present poses, minimised over
// the node's pose. Only relative poses of its neighbours are left in it: no frame plays a part.
//
// No neighbour or one: nothing. Two: one GraphConstraint. Up to `dense_neighbours_max`: one
// JointConstraint. These are exact whatever the rank of the constraints is; in directions that the
// node knew nothing about they say nothing. Where the constraints of the node disagree with each
// other, the new ones keep the pull that this leaves on the neighbours, and drop the chi2 that no
// neighbour can change.
//
// More: the tree of GraphConstraints, each with the inverse of the covariance that the exact result
// gives to the relative pose of its two nodes, of the least Kullback-Leibler divergence from the
// exact result of all trees over the neighbours. That is the tree of the least sum of log
// determinants of these covariances: Chow and Liu, "Approximating discrete probability
// distributions with dependence trees", 1968, for relative poses; Kretzschmar and Stachniss,
// "Information-theoretic compression of pose graphs for laser-based SLAM", IJRR 2012; Mazuran,
// Burgard and Tipaldi, "Nonlinear factor recovery for long-term SLAM", IJRR 2016. The papers give
// the new constraints the exact result's mean. Here they have its gradient at the present poses: at
// an optimum of the graph, the other nodes' poses stay an optimum. Every information is positive
// definite.
//
// The graph must be valid (ValidateGraph), and is best at its optimum: the result is as good as the
// poses at which it is linearised. Errors, kFailedPrecondition, each naming node and reason: the
// node is fixed, or has a prior or a point constraint; there are more than `dense_neighbours_max`
// neighbours, and constraints that do not determine all of their relative poses; the constraints
// disagree by half a turn or more. kInvalidArgument: no such node, or a constraint from the node to
// itself.
StatusOr<NodeMarginal> MarginalOf(const PoseGraph& graph,
                                  std::uint32_t node,
                                  const MarginalOptions& options);

// The same, and messages that do not name the node: for those who know it by another number.
StatusOr<NodeMarginal> UnnamedMarginalOf(const PoseGraph& graph,
                                         std::uint32_t node,
                                         const MarginalOptions& options);

// One constraint over all the nodes of some, which are one or more: their sum as it is linearised
// at the present poses, less the chi2 that no pose can change. kFailedPrecondition if they disagree
// by half a turn or more.
StatusOr<JointConstraint> SumOf(const PoseGraph& graph,
                                const std::vector<JointConstraint>& constraints);

// Removes a node and its constraints, and adds its marginal after the other constraints. Nodes
// above it move down by one number. Errors: those of MarginalOf; the graph is unchanged then.
Status MarginaliseNode(std::uint32_t node, const MarginalOptions& options, PoseGraph& graph);

}  // namespace loci
