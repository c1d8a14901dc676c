// SPDX-License-Identifier: Apache-2.0
// Which graphs gradient descent may sweep: it keeps every constraint's path as a list.
#pragma once

#include <cstddef>

#include "core/graph/pose_graph.h"
#include "core/graph/space_graph.h"

namespace loci {

// Elements of all paths through the breadth-first tree, at most; about 1 GiB of lists. Public
// graphs of 10^4 nodes have 2 * 10^5, but a long ring whose far ends are tied again and again has
// as many as nodes times constraints.
inline constexpr std::size_t kPathElementsMax = std::size_t{1} << 27U;

// False beyond kPathElementsMax. Then nobody may make a ToroOptimizer or SpaceToroOptimizer of it;
// the optimisers that are exact need no paths.
bool IsSweepable(const PoseGraph& graph);
bool IsSweepable(const SpaceGraph& graph);

}  // namespace loci
