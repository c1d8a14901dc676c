// SPDX-License-Identifier: Apache-2.0
// A constraint between any number of nodes: linearised, as a term, and taken for pairs.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "core/graph/pose_graph.h"

namespace loci {

// For right perturbations, map_from_node * Exp(xi), of the constraint's nodes.
struct LinearisedJoint {
  Eigen::VectorXd error;
  Eigen::MatrixXd jacobian;  // three columns per node, in the order of the constraint
};
LinearisedJoint Linearised(const PoseGraph& graph, const JointConstraint& constraint);

// Writes H = J^T W J and b = -J^T W e as one term of an EliminationTree over the nodes that are
// free, in the order of the constraint. `is_free` per node; at least one is.
void WriteTerm(const LinearisedJoint& linearised,
               const Eigen::MatrixXd& weight,
               const std::vector<bool>& is_free,
               double* values);

// A constraint of two nodes, in either form.
GraphConstraint PairOf(const JointConstraint& constraint);
JointConstraint JointOf(const GraphConstraint& constraint);

// What the constraint says of nodes[0] and nodes[i], i > 0, whatever the others do: the exact
// marginal for its linear model at its measurements.
GraphConstraint ImpliedPair(const JointConstraint& constraint, std::size_t i);

// The graph with the implied pairs of each joint constraint in its place, after the other
// constraints: for starts and for descent along a tree, which know pairs only. Its minimum is not
// that of the graph.
PoseGraph WithImpliedPairs(PoseGraph graph);

}  // namespace loci
