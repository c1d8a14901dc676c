// SPDX-License-Identifier: Apache-2.0
// Pose graphs by Ceres: the reference that tests hold our optimum against, the peer of the
// benchmarks, and `loci graph optimize --method ceres` where it is built in (docs/licences.md).
#pragma once

#include "core/graph/pose_graph.h"
#include "core/graph/space_graph.h"
#include "core/graph/sparse_optimizer.h"

namespace loci {

struct CeresOptions {
  int iterations_max = 500;
  double stop_at_chi2 = 0.0;  // ends as soon as chi2 is this low; 0: at convergence only
};

// Moves the free nodes and points to a local minimum of chi2, by Levenberg-Marquardt over sparse
// normal equations, on one thread: one residual block per constraint and per prior, with analytic
// Jacobians. No kernel. Holds what OptimizeSparse holds. Not for results that enter the state of an
// engine: the bits depend on the BLAS of the machine. The graph must be valid.
OptimizationSummary OptimizeByCeres(PoseGraph& graph, const CeresOptions& options);
OptimizationSummary OptimizeByCeres(SpaceGraph& graph, const CeresOptions& options);

}  // namespace loci
