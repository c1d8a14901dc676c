// SPDX-License-Identifier: Apache-2.0
// Gradient descent where it helps, then Gauss-Newton.
#include "core/graph/optimize.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/graph/plane_problem.h"
#include "core/graph/toro_optimizer.h"
#include "core/graph/toro_tree.h"

namespace loci {
namespace {

// Costs that differ by less than this part of them are one minimum, or one start.
constexpr double kSameCostRelative = 1e-6;
// A start that is any good is near its minimum after fewer steps than this; only the best goes on.
constexpr int kAttemptIterationsMax = 50;

bool SameCost(double a, double b) {
  return std::abs(a - b) <= kSameCostRelative * std::max(std::abs(a), std::abs(b));
}

// Whether all runs converged to one minimum, and did not all begin at one place.
bool AgreeOnMinimum(const std::vector<OptimizationSummary>& runs) {
  bool began_apart = false;
  for (const OptimizationSummary& run : runs) {
    if (!run.converged || !SameCost(run.cost_after, runs.front().cost_after)) {
      return false;
    }
    began_apart = began_apart || !SameCost(run.cost_before, runs.front().cost_before);
  }
  return began_apart;
}

}  // namespace

StatusOr<OptimizationSummary> OptimizeGraph(PoseGraph& graph, const OptimizeOptions& options) {
  LOCI_RETURN_IF_ERROR(ValidateGraph(graph));
  const double chi2_before = Chi2(graph);
  const double cost_before = PlaneProblem(graph, options.sparse.kernel).Cost();
  if (options.toro_sweeps > 0) {
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

StatusOr<BestStartSummary> OptimizeFromBestStart(PoseGraph& graph, const SparseOptions& options) {
  LOCI_RETURN_IF_ERROR(ValidateGraph(graph));
  const PoseGraph given = graph;
  SparseOptions attempt_options = options;
  attempt_options.iterations_max = std::min(options.iterations_max, kAttemptIterationsMax);
  BestStartSummary best;
  std::vector<OptimizationSummary> runs;
  for (const GraphStart start :
       {GraphStart::kGiven, GraphStart::kTree, GraphStart::kSwept, GraphStart::kPrefixes}) {
    if (start == GraphStart::kPrefixes && AgreeOnMinimum(runs)) {
      break;
    }
    PoseGraph attempt = given;
    PlaceAtStart(start, attempt);
    runs.push_back(OptimizeSparse(attempt, attempt_options));
    if (runs.size() == 1 || runs.back().cost_after < best.optimization.cost_after) {
      best.optimization = runs.back();
      best.start = start;
      graph = std::move(attempt);
    }
  }
  if (!best.optimization.converged && options.iterations_max > kAttemptIterationsMax) {
    SparseOptions rest = options;
    rest.iterations_max -= kAttemptIterationsMax;
    const int iterations = best.optimization.iterations;
    best.optimization = OptimizeSparse(graph, rest);
    best.optimization.iterations += iterations;
  }
  best.optimization.chi2_before = runs.front().chi2_before;
  best.optimization.cost_before = runs.front().cost_before;
  return best;
}

}  // namespace loci
