// SPDX-License-Identifier: Apache-2.0
// Spanning trees by weight: which constraints to trust when poses are composed.
#pragma once

#include <vector>

#include "core/graph/pose_graph.h"
#include "core/graph/space_graph.h"
#include "core/graph/toro_tree.h"

namespace loci {

// Of the constraints (of a graph in space: of its topology), one cost each, >= 0. Roots are the
// held nodes; nodes that no root reaches make their lowest one a root. Equal costs: the constraint
// with the lower index.
//
// The sum of the costs of all constraints in the tree is the least (Prim 1957).
ToroTree MinimumSpanningTree(const PoseGraph& graph, const std::vector<double>& costs);
// For each node, the sum along its path from the root is the least (Dijkstra 1959).
ToroTree ShortestPathTree(const PoseGraph& graph, const std::vector<double>& costs);

// |to - from| of each constraint: its spanning tree is the odometry, wherever there is one.
std::vector<double> StepCosts(const PoseGraph& graph);

// How far a constraint lets a node be off, in m^2: the variance of the position, and that of the
// turn times the square of the distance over which it acts. That distance is the extent of a random
// walk with as many steps as the graph has nodes, as long as the constraints are: a turn moves all
// that hangs behind it. The path with the least sum is the one of minimum uncertainty, as far as
// variances add up.
std::vector<double> UncertaintyCosts(const PoseGraph& graph);
std::vector<double> UncertaintyCosts(const SpaceGraph& graph);

}  // namespace loci
