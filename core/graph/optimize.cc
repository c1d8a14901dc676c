// SPDX-License-Identifier: Apache-2.0
// Gradient descent where it helps, then Gauss-Newton.
#include "core/graph/optimize.h"

#include <utility>

#include "core/graph/plane_problem.h"
#include "core/graph/sweep_limit.h"
#include "core/graph/toro_optimizer.h"
#include "core/graph/toro_tree.h"

namespace loci {

StatusOr<OptimizationSummary> OptimizeGraph(PoseGraph& graph, const OptimizeOptions& options) {
  LOCI_RETURN_IF_ERROR(ValidateGraph(graph));
  const double chi2_before = Chi2(graph);
  const double cost_before = PlaneProblem(graph, options.sparse.kernel).Cost();
  if (options.toro_sweeps > 0 && IsSweepable(graph)) {
    ToroOptimizer toro(graph);
    for (int i = 0; i < options.toro_sweeps; ++i) {
      toro.Sweep();
    }
    PoseGraph swept = graph;
    swept.map_from_node = toro.Poses();
    PlacePoints(swept);
    if (PlaneProblem(swept, options.sparse.kernel).Cost() < cost_before) {
      graph = std::move(swept);
    }
  }
  OptimizationSummary summary = OptimizeSparse(graph, options.sparse);
  summary.chi2_before = chi2_before;
  summary.cost_before = cost_before;
  return summary;
}

}  // namespace loci
