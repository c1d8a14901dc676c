// SPDX-License-Identifier: Apache-2.0
// A pose graph as a robot records it: node by node, each with what it is tied by to those before.
#pragma once

#include <cstdint>
#include <vector>

#include "core/graph/pose_graph.h"

namespace loci {

// The order of the nodes is that of their index. Constraints and priors are those of the graph, by
// their index there. Refers to a valid graph that lives longer and keeps its constraints.
class RecordingOrder {
 public:
  explicit RecordingOrder(const PoseGraph& graph);

  // To nodes before `node`.
  const std::vector<std::uint32_t>& Constraints(std::uint32_t node) const {
    return constraints_[node];
  }
  // From `node` to any point.
  const std::vector<std::uint32_t>& PointConstraints(std::uint32_t node) const {
    return point_constraints_[node];
  }

  // Where the constraint to the latest node before `node` says that it is: most often odometry.
  // `pose_of(index)` is the pose of a node before it. Without such a constraint, and for a fixed
  // node, the graph's pose.
  template <typename PoseOf>
  Pose2 PlaceOf(std::uint32_t node, const PoseOf& pose_of) const {
    if (graph_->IsFixed(node) || constraints_[node].empty()) {
      return graph_->map_from_node[node];
    }
    const GraphConstraint& latest = Latest(node);
    return latest.to == node ? pose_of(latest.from) * latest.from_from_to
                             : pose_of(latest.to) * Inverse(latest.from_from_to);
  }

 private:
  const GraphConstraint& Latest(std::uint32_t node) const;

  const PoseGraph* graph_;
  std::vector<std::vector<std::uint32_t>> constraints_;
  std::vector<std::vector<std::uint32_t>> point_constraints_;
};

}  // namespace loci
