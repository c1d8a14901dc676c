// SPDX-License-Identifier: Apache-2.0
// A pose graph in space as a least squares problem, and its optimisation.
#pragma once

#include "core/graph/linearised_prior.h"
#include "core/graph/normal_equations.h"
#include "core/graph/space_graph.h"
#include "core/graph/sparse_optimizer.h"

namespace loci {

// Error and Jacobians for right perturbations (translation, rotation vector) of the nodes, and for
// a shift of the point in the map.
LinearisedPair<6, 6, 6> Linearised(const SpaceGraph& graph, const SpaceConstraint& constraint);
LinearisedPair<3, 6, 3> Linearised(const SpaceGraph& graph, const SpacePointConstraint& constraint);
LinearisedPrior<6, 6> Linearised(const SpaceGraph& graph, const SpacePosePrior& prior);
LinearisedPrior<3, 6> Linearised(const SpaceGraph& graph, const SpacePositionPrior& prior);

// Moves the free nodes and points to a local minimum of chi2. The options' kernel plays no part.
// The graph must be valid.
OptimizationSummary OptimizeSparse(SpaceGraph& graph, const SparseOptions& options);

}  // namespace loci
