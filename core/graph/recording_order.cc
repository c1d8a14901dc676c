// SPDX-License-Identifier: Apache-2.0
// Constraints by the later of their nodes.
#include "core/graph/recording_order.h"

#include <algorithm>

namespace loci {

RecordingOrder::RecordingOrder(const PoseGraph& graph)
    : graph_(&graph),
      constraints_(graph.map_from_node.size()),
      point_constraints_(graph.map_from_node.size()) {
  for (std::uint32_t i = 0; i < graph.constraints.size(); ++i) {
    const GraphConstraint& constraint = graph.constraints[i];
    constraints_[std::max(constraint.from, constraint.to)].push_back(i);
  }
  for (std::uint32_t i = 0; i < graph.point_constraints.size(); ++i) {
    point_constraints_[graph.point_constraints[i].from].push_back(i);
  }
}

// Of several, the first.
const GraphConstraint& RecordingOrder::Latest(std::uint32_t node) const {
  const auto earlier = [&](std::uint32_t i) {
    return std::min(graph_->constraints[i].from, graph_->constraints[i].to);
  };
  const auto latest = std::max_element(
      constraints_[node].begin(), constraints_[node].end(), [&](std::uint32_t a, std::uint32_t b) {
        return earlier(a) < earlier(b);
      });
  return graph_->constraints[*latest];
}

}  // namespace loci
