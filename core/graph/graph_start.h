// SPDX-License-Identifier: Apache-2.0
// Starts for an optimisation: poses near enough to the optimum that Gauss-Newton finds it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/graph/pose_graph.h"

namespace loci {

enum class GraphStart : std::uint8_t {
  kGiven,     // the poses as they are, often raw odometry
  kTree,      // composed along the breadth-first tree: drifts by the depth of the tree only
  kSwept,     // the tree's, after sweeps of gradient descent
  kPrefixes,  // node by node in the order of their index, as if the graph had just been recorded;
              // priors and fixed points play no part until the whole is optimised
};

// "given", "tree", "swept", "prefixes".
std::string_view GraphStartName(GraphStart start);

// Puts the free nodes and the points of a valid graph where the start says. The given start places
// nothing.
void PlaceAtStart(GraphStart start, PoseGraph& graph);

// Places nodes in the order of their index: each by a constraint to an earlier one, then, after
// every `batch_count` nodes, all so far are optimised. Costs many optimisations, and escapes minima
// in which every start ends that trusts a long stretch of odometry.
void PlaceByPrefixes(std::size_t batch_count, PoseGraph& graph);

}  // namespace loci
