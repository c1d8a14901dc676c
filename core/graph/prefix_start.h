// SPDX-License-Identifier: Apache-2.0
// A start that builds the graph up node by node, as if it had just been recorded.
#pragma once

#include <cstddef>

#include "core/graph/pose_graph.h"

namespace loci {

// Places nodes in the order of their index: each by a constraint to an earlier one, then, after
// every `batch_count` nodes, all so far are optimised. Costs many optimisations, and escapes minima
// in which every start ends that trusts a long stretch of odometry. Not for graphs with joint
// constraints: PlaceAtStart gives it their implied pairs.
void PlaceByPrefixes(std::size_t batch_count, PoseGraph& graph);

}  // namespace loci
