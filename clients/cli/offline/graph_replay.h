// SPDX-License-Identifier: Apache-2.0
// A graph in a file, built up pose by pose as a robot would have done it.
#pragma once

#include <functional>
#include <vector>

#include "core/base/status.h"
#include "core/graph/pose_graph.h"

namespace loci::cli {

struct GraphReplay {
  std::vector<double> step_s;  // per node, by the clock that ReplayGraph was given
  int iterations = 0;          // steps of Gauss-Newton
};

// Adds the nodes in the order of their index, each with the constraints to earlier ones and with
// the points that it sees, and brings all to the optimum after each. Moves the graph's nodes and
// points to where they are in the end. The graph must be valid.
//
// Errors, which name the option --incremental: kUnimplemented for priors and fixed points, by the
// name of their record; kFailedPrecondition if in the end some node or point is not tied in all
// directions. The graph is unchanged then.
StatusOr<GraphReplay> ReplayGraph(PoseGraph& graph, const std::function<double()>& clock_s);

}  // namespace loci::cli
