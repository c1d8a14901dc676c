// SPDX-License-Identifier: Apache-2.0
// Pose graphs in space, SE(3): for offline optimisation; the engine's graphs lie in the plane.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/base/status.h"
#include "core/geometry/se3.h"
#include "core/graph/normal_equations.h"
#include "core/graph/sparse_optimizer.h"
#include "core/graph/toro_tree.h"

namespace loci {

// A measured pose of node `to` in the frame of node `from`.
//
// Error: (translation, vector part of the unit quaternion with w >= 0) of
// Inverse(from_from_to) * Inverse(map_from_from) * map_from_to, as g2o's EDGE_SE3:QUAT has it.
struct SpaceConstraint {
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  Pose3 from_from_to;
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();
};

// Nodes and constraints; which nodes an optimiser holds is as for PoseGraph.
struct SpaceGraph {
  std::vector<Pose3> map_from_node;
  std::vector<SpaceConstraint> constraints;
  std::vector<bool> fixed;
};

Eigen::Matrix<double, 6, 1> ErrorOf(const SpaceGraph& graph, const SpaceConstraint& constraint);
// The sum of e^T Omega e, in the order of the constraints.
double Chi2(const SpaceGraph& graph);
// As ValidateGraph for the plane.
Status ValidateGraph(const SpaceGraph& graph);

GraphComponents FindComponents(const SpaceGraph& graph);
ToroTree BreadthFirstTree(const SpaceGraph& graph);
void PlaceByTree(const ToroTree& tree, SpaceGraph& graph);

// Error and Jacobians for right perturbations (translation, rotation vector) of the nodes.
LinearisedPair<6, 6, 6> Linearised(const SpaceGraph& graph, const SpaceConstraint& constraint);

// Moves the free nodes to a local minimum of chi2. The options' kernel plays no part.
OptimizationSummary OptimizeSparse(SpaceGraph& graph, const SparseOptions& options);

}  // namespace loci
