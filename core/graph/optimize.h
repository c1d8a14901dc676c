// SPDX-License-Identifier: Apache-2.0
// Optimisation of a pose graph from start to finish: tree-parameterised gradient descent, then
// Gauss-Newton to convergence.
#pragma once

#include "core/base/status.h"
#include "core/graph/pose_graph.h"
#include "core/graph/sparse_optimizer.h"

namespace loci {

struct OptimizeOptions {
  // Sweeps of gradient descent before Gauss-Newton; 0 turns them off, as graphs do that are not
  // sweepable (sweep_limit.h). Their result is used only where its cost is below that of the poses
  // given.
  int toro_sweeps = 10;
  SparseOptions sparse;
};

// Moves free nodes and points of `graph` to a minimum of the cost, starting at its poses. Never
// ends above the cost it began with. Fixed order throughout: the same graph gives the same bits.
// Errors: those of ValidateGraph; the graph is unchanged then.
StatusOr<OptimizationSummary> OptimizeGraph(PoseGraph& graph, const OptimizeOptions& options);

}  // namespace loci
