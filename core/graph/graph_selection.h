// SPDX-License-Identifier: Apache-2.0
// Some of the constraints and priors of a pose graph.
#pragma once

#include <vector>

#include "core/graph/pose_graph.h"
#include "core/graph/sparse_optimizer.h"

namespace loci {

// Per constraint and prior, in the order of the graph, whether it is meant. Joint constraints
// always are.
struct GraphSelection {
  std::vector<bool> constraints;
  std::vector<bool> point_constraints;
  std::vector<bool> pose_priors;
  std::vector<bool> position_priors;

  friend bool operator==(const GraphSelection&, const GraphSelection&) = default;
};

GraphSelection AllOf(const PoseGraph& graph);
// Those that are not marked robust.
GraphSelection TrustedOf(const PoseGraph& graph);

// All nodes and points, with the selected constraints and priors only.
PoseGraph PartOf(const PoseGraph& graph, const GraphSelection& selection);

// Moves the nodes and points of `graph` to where they are in a part of it.
void TakePoses(PoseGraph&& part, PoseGraph& graph);

// OptimizeSparse over the selected constraints and priors only.
OptimizationSummary OptimizePart(const GraphSelection& selection,
                                 const SparseOptions& options,
                                 PoseGraph& graph);

}  // namespace loci
