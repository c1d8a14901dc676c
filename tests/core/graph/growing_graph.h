// SPDX-License-Identifier: Apache-2.0
// A graph as it was while it was recorded.
#pragma once

#include <algorithm>
#include <cstddef>

#include "core/graph/pose_graph.h"

namespace loci {

// The first nodes, and the constraints between them.
inline PoseGraph PrefixOf(const PoseGraph& graph, std::size_t node_count) {
  PoseGraph prefix;
  prefix.map_from_node.assign(
      graph.map_from_node.begin(),
      graph.map_from_node.begin() + static_cast<std::ptrdiff_t>(node_count));
  for (const GraphConstraint& constraint : graph.constraints) {
    if (std::max(constraint.from, constraint.to) < node_count) {
      prefix.constraints.push_back(constraint);
    }
  }
  return prefix;
}

}  // namespace loci
