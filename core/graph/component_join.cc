// SPDX-License-Identifier: Apache-2.0
// Rigid motions of whole components.
#include "core/graph/component_join.h"

#include <algorithm>
#include <cstddef>

namespace loci {
namespace {

// Whether the component has something that says where in the map it is.
bool IsTied(const PoseGraph& graph, const GraphComponents& components, std::uint32_t component) {
  for (std::size_t i = 0; i < components.of_node.size(); ++i) {
    if (components.of_node[i] == component && graph.IsFixed(i)) {
      return true;
    }
  }
  for (std::size_t i = 0; i < components.of_point.size(); ++i) {
    if (components.of_point[i] == component && graph.IsPointFixed(i)) {
      return true;
    }
  }
  const auto is_here = [&](const auto& prior) {
    return components.of_node[prior.node] == component;
  };
  return std::any_of(graph.pose_priors.begin(), graph.pose_priors.end(), is_here) ||
         std::any_of(graph.position_priors.begin(), graph.position_priors.end(), is_here);
}

void MoveComponent(const GraphComponents& components,
                   std::uint32_t component,
                   const Pose2& new_from_old,
                   PoseGraph& graph) {
  for (std::size_t i = 0; i < components.of_node.size(); ++i) {
    if (components.of_node[i] == component) {
      graph.map_from_node[i] = new_from_old * graph.map_from_node[i];
    }
  }
  for (std::size_t i = 0; i < components.of_point.size(); ++i) {
    if (components.of_point[i] == component) {
      graph.points_in_map[i] = new_from_old * graph.points_in_map[i];
    }
  }
}

}  // namespace

void JoinComponents(std::uint32_t a, std::uint32_t b, const Pose2& a_from_b, PoseGraph& graph) {
  const GraphComponents components = FindComponents(graph);
  const std::uint32_t component_a = components.of_node[a];
  const std::uint32_t component_b = components.of_node[b];
  if (component_a == component_b) {
    return;
  }
  const Pose2 map_from_a = graph.map_from_node[a];
  const Pose2 map_from_b = graph.map_from_node[b];
  if (!IsTied(graph, components, component_b)) {
    MoveComponent(components, component_b, map_from_a * a_from_b * Inverse(map_from_b), graph);
  } else if (!IsTied(graph, components, component_a)) {
    MoveComponent(components, component_a, map_from_b * Inverse(map_from_a * a_from_b), graph);
  }
}

}  // namespace loci
