// SPDX-License-Identifier: Apache-2.0
// The incremental optimiser, fed from a file.
#include "clients/cli/offline/graph_replay.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "core/graph/incremental_optimizer.h"
#include "core/graph/recording_order.h"

namespace loci::cli {
namespace {

constexpr std::uint32_t kAbsent = 0xFFFFFFFFU;

class Replay {
 public:
  explicit Replay(const PoseGraph& whole)
      : whole_(whole), order_(whole), index_of_point_(whole.points_in_map.size(), kAbsent) {}

  UpdateSummary AddNode(std::uint32_t node) {
    optimizer_.AddNode(
        order_.PlaceOf(node, [&](std::uint32_t i) { return optimizer_.map_from_node(i); }),
        whole_.IsFixed(node));
    for (const std::uint32_t i : order_.Constraints(node)) {
      optimizer_.AddConstraint(whole_.constraints[i]);
    }
    for (const std::uint32_t i : order_.PointConstraints(node)) {
      PointConstraint constraint = whole_.point_constraints[i];
      std::uint32_t& index = index_of_point_[constraint.point];
      if (index == kAbsent) {
        index = optimizer_.AddPoint(optimizer_.map_from_node(node) * constraint.point_in_from);
      }
      constraint.point = index;
      optimizer_.AddConstraint(constraint);
    }
    return optimizer_.Update();
  }

  void CopyTo(PoseGraph& graph) const {
    for (std::uint32_t i = 0; i < graph.map_from_node.size(); ++i) {
      graph.map_from_node[i] = optimizer_.map_from_node(i);
    }
    for (std::size_t i = 0; i < index_of_point_.size(); ++i) {
      if (index_of_point_[i] != kAbsent) {
        graph.points_in_map[i] = optimizer_.point_in_map(index_of_point_[i]);
      }
    }
  }

 private:
  const PoseGraph& whole_;
  RecordingOrder order_;
  std::vector<std::uint32_t> index_of_point_;  // in the optimiser
  IncrementalOptimizer optimizer_{IncrementalOptions{}};
};

Status CheckReplayable(const PoseGraph& graph) {
  const auto refused = [](const std::string& record) {
    return UnimplementedError("--incremental: the file has " + record +
                              ", which only a graph as a whole can have");
  };
  if (!graph.pose_priors.empty()) {
    return refused("EDGE_PRIOR_SE2");
  }
  if (!graph.position_priors.empty()) {
    return refused("EDGE_PRIOR_SE2_XY");
  }
  if (std::find(graph.fixed_points.begin(), graph.fixed_points.end(), true) !=
      graph.fixed_points.end()) {
    return refused("FIX of a VERTEX_XY");
  }
  return {};
}

}  // namespace

StatusOr<GraphReplay> ReplayGraph(PoseGraph& graph, const std::function<double()>& clock_s) {
  LOCI_RETURN_IF_ERROR(CheckReplayable(graph));
  GraphReplay result;
  result.step_s.reserve(graph.map_from_node.size());
  Replay replay(graph);
  UpdateSummary update;
  for (std::uint32_t node = 0; node < graph.map_from_node.size(); ++node) {
    const double begin_s = clock_s();
    update = replay.AddNode(node);
    result.step_s.push_back(clock_s() - begin_s);
    result.iterations += update.iterations;
  }
  if (!update.determined) {
    return FailedPreconditionError(
        "--incremental: some pose or point is not tied in all directions");
  }
  replay.CopyTo(graph);
  return result;
}

}  // namespace loci::cli
