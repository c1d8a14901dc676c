// SPDX-License-Identifier: Apache-2.0
#include "core/graph/sweep_limit.h"

#include <cstdint>

#include "core/graph/toro_tree.h"

namespace loci {
namespace {

// Joint constraints add what their pairs' paths have; those are short.
template <typename Graph>
bool IsWithinLimit(const Graph& graph) {
  const ToroTree tree = BreadthFirstTree(graph);
  std::size_t elements = 0;
  for (const auto& constraint : graph.constraints) {
    std::uint32_t a = constraint.from;
    std::uint32_t b = constraint.to;
    // Never past a root: two trees have no path between them.
    while (a != b && (tree.depth[a] > 0 || tree.depth[b] > 0)) {
      std::uint32_t& deeper = tree.depth[a] >= tree.depth[b] ? a : b;
      deeper = tree.parent[deeper];
      ++elements;
    }
    if (elements > kPathElementsMax) {
      return false;
    }
  }
  return true;
}

}  // namespace

bool IsSweepable(const PoseGraph& graph) {
  return IsWithinLimit(graph);
}
bool IsSweepable(const SpaceGraph& graph) {
  return IsWithinLimit(graph);
}

}  // namespace loci
