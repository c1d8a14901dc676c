// SPDX-License-Identifier: Apache-2.0
// Optimisation of a graph of which nothing is known: from several starts.
#pragma once

#include <functional>
#include <vector>

#include "core/base/status.h"
#include "core/graph/graph_start.h"
#include "core/graph/pose_graph.h"
#include "core/graph/space_graph.h"
#include "core/graph/sparse_optimizer.h"

namespace loci {

struct BestStartOptions {
  SparseOptions sparse;
  // A clock of the caller, in seconds, for the times in the summary; without one they stay 0.
  std::function<double()> clock_s;
};

// One start that was optimised from.
struct StartAttempt {
  GraphStart start = GraphStart::kGiven;
  double cost_before = 0.0;
  double cost_after = 0.0;
  int iterations = 0;
  bool converged = false;
};

struct BestStartSummary {
  OptimizationSummary optimization;       // "before" is at the given poses
  GraphStart start = GraphStart::kGiven;  // whose minimum is the lowest
  std::vector<StartAttempt> attempts;     // in their order
  double start_s = 0.0;                   // spent on placing nodes
  double solve_s = 0.0;                   // and on moving them to minima
};

// Places the graph at all cheap starts, and optimises from them in the order of their cost, until
// two that began at different poses have converged to the lowest minimum so far: one alone may be a
// local one. Sweeps and prefixes are tried only if the others do not agree. The best is then
// brought to convergence. Errors: those of ValidateGraph; the graph is unchanged then.
StatusOr<BestStartSummary> OptimizeFromBestStart(PoseGraph& graph, const BestStartOptions& options);
StatusOr<BestStartSummary> OptimizeFromBestStart(SpaceGraph& graph,
                                                 const BestStartOptions& options);

// Places the graph at the cheap start with the lowest chi2, without optimising; returns it.
GraphStart PlaceAtBestStart(PoseGraph& graph);
GraphStart PlaceAtBestStart(SpaceGraph& graph);

}  // namespace loci
