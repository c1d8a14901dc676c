// SPDX-License-Identifier: Apache-2.0
// Starts for an optimisation: poses near enough to the optimum that Gauss-Newton finds it.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "core/graph/pose_graph.h"
#include "core/graph/space_graph.h"

namespace loci {

enum class GraphStart : std::uint8_t {
  kGiven,            // the poses as they are: those of the file, most often
  kOdometry,         // composed from each node to the next, where a constraint joins them
  kTree,             // composed along the breadth-first tree: drifts by the depth of the tree only
  kUncertaintyTree,  // composed along the paths of minimum uncertainty (spanning_tree.h)
  kChordal,          // all constraints at once, relaxed to linear problems (chordal_start.h)
  kSwept,            // the breadth-first tree's, after sweeps of gradient descent (sweep_limit.h)
  kPrefixes,         // node by node, as if the graph had just been recorded (prefix_start.h)
};

// "file", "odometry", "tree", "uncertainty-tree", "chordal", "swept", "prefixes".
std::string_view GraphStartName(GraphStart start);

// Which starts there are, cheap ones first. In space all but the last one.
std::span<const GraphStart> StartsFor(const PoseGraph& graph);
std::span<const GraphStart> StartsFor(const SpaceGraph& graph);

// Puts the free nodes and points of a valid graph where the start says, and each component that is
// tied to the map where its priors say. The given start places nothing. In space the start must be
// one of StartsFor. Joint constraints are taken for their implied pairs (joint_constraint.h). A
// graph that is not sweepable (sweep_limit.h) stays on the tree where it should be swept.
void PlaceAtStart(GraphStart start, PoseGraph& graph);
void PlaceAtStart(GraphStart start, SpaceGraph& graph);

}  // namespace loci
