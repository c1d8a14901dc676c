// SPDX-License-Identifier: Apache-2.0
// Believing closures one after the other, the certain ones first.
#pragma once

#include <cstddef>
#include <vector>

#include "core/graph/closure_clusters.h"
#include "core/graph/pose_graph.h"

namespace loci {

// How many clusters are held against each other where no single one is certain enough.
inline constexpr std::size_t kAgreeingMax = 128;

// The graph without closures is trusted. In rounds, every cluster that is still open is held
// against what the graph knows of its two ends by now; it is believed if it fits and hardly any
// false one would, which is the case where the graph knows much. What is believed moves the graph
// and makes it stiffer, so that the next round can tell more. A cluster that no longer fits
// afterwards is open again.
//
// Where nothing is certain enough, clusters are held against each other, each two with the ways
// between their ends as the graph knows them (Mangelson et al.: at most kAgreeingMax of them, those
// about whose ends most is known), and the heaviest set of those that agree is believed. Two
// components of the graph are only joined by such a set, never by one cluster.
//
// Closures without any others near them come last: they are the many, and little speaks for them.
//
// Points and priors take part as far as they are not robust.
// Returns which constraints are believed, and moves `graph` near to the optimum over them. Costs
// some tens of optimisations, and one search for a path per open cluster and round.
std::vector<bool> GrowByClosures(const ClosureClusters& clusters, PoseGraph& graph);

}  // namespace loci
