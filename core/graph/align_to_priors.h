// SPDX-License-Identifier: Apache-2.0
// A component that is tied to the map, moved as a whole to where its ties say.
#pragma once

#include "core/graph/pose_graph.h"
#include "core/graph/robust_kernel.h"
#include "core/graph/space_graph.h"

namespace loci {

// Gauss-Newton follows a turn of a whole map badly: each node would have to move along an arc. So
// every component without a fixed node is first moved rigidly, in closed form, so that its nodes
// fit their priors and the fixed points that they see (Kabsch 1976; B. K. P. Horn 1987), with the
// mean of each information as weight. A component for which that does not lower the cost stays. A
// direction of which the ties say nothing is not turned.
//
// Returns by how much the cost has fallen, with the kernel for terms marked robust.
double AlignToPriors(PoseGraph& graph, const RobustKernel& kernel);
double AlignToPriors(SpaceGraph& graph);

}  // namespace loci
