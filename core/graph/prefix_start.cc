// SPDX-License-Identifier: Apache-2.0
// Growing a graph, with an optimisation now and then.
#include "core/graph/prefix_start.h"

#include <cstdint>
#include <vector>

#include "core/base/check.h"
#include "core/graph/recording_order.h"
#include "core/graph/sparse_optimizer.h"

namespace loci {
namespace {

// A prefix need not be exact, only right: the next one moves it again.
constexpr int kPrefixIterationsMax = 20;
constexpr double kPrefixGainMin = 1e-4;

// Grows a graph node by node.
class PrefixGraph {
 public:
  explicit PrefixGraph(const PoseGraph& whole)
      : whole_(whole),
        order_(whole),
        priors_of_(whole.map_from_node.size()),
        index_of_point_(whole.points_in_map.size(), kAbsent) {
    for (const PosePrior& prior : whole.pose_priors) {
      priors_of_[prior.node].poses.push_back(prior);
    }
    for (const PositionPrior& prior : whole.position_priors) {
      priors_of_[prior.node].positions.push_back(prior);
    }
  }

  std::size_t size() const { return prefix_.map_from_node.size(); }

  // Adds the next node. Returns true if it closes a loop, or ties the graph to the map.
  bool AddNode() {
    const auto node = static_cast<std::uint32_t>(size());
    const std::vector<std::uint32_t>& constraints = order_.Constraints(node);
    prefix_.map_from_node.push_back(
        order_.PlaceOf(node, [&](std::uint32_t i) { return prefix_.map_from_node[i]; }));
    prefix_.fixed.push_back(whole_.IsFixed(node));
    for (const std::uint32_t i : constraints) {
      prefix_.constraints.push_back(whole_.constraints[i]);
    }
    bool closes_loop = constraints.size() > 1;
    for (const std::uint32_t i : order_.PointConstraints(node)) {
      closes_loop = AddPointConstraint(whole_.point_constraints[i]) || closes_loop;
    }
    const Priors& priors = priors_of_[node];
    prefix_.pose_priors.insert(prefix_.pose_priors.end(), priors.poses.begin(), priors.poses.end());
    prefix_.position_priors.insert(
        prefix_.position_priors.end(), priors.positions.begin(), priors.positions.end());
    return closes_loop || !priors.poses.empty() || !priors.positions.empty();
  }

  void Optimize() {
    SparseOptions options;
    options.iterations_max = kPrefixIterationsMax;
    options.relative_gain_min = kPrefixGainMin;
    OptimizeSparse(prefix_, options);
  }

  // The poses and points that have been placed, into the whole graph.
  void CopyTo(PoseGraph& graph) const {
    graph.map_from_node = prefix_.map_from_node;
    for (std::size_t i = 0; i < index_of_point_.size(); ++i) {
      if (index_of_point_[i] != kAbsent) {
        graph.points_in_map[i] = prefix_.points_in_map[index_of_point_[i]];
      }
    }
  }

 private:
  static constexpr std::uint32_t kAbsent = 0xFFFFFFFFU;

  bool AddPointConstraint(PointConstraint constraint) {
    std::uint32_t& index = index_of_point_[constraint.point];
    const bool seen_before = index != kAbsent;
    const bool fixed = whole_.IsPointFixed(constraint.point);
    if (!seen_before) {
      index = static_cast<std::uint32_t>(prefix_.points_in_map.size());
      prefix_.points_in_map.push_back(
          fixed
              ? whole_.points_in_map[constraint.point]
              : Eigen::Vector2d(prefix_.map_from_node[constraint.from] * constraint.point_in_from));
      prefix_.fixed_points.push_back(fixed);
    }
    constraint.point = index;
    prefix_.point_constraints.push_back(constraint);
    return seen_before || fixed;
  }

  struct Priors {
    std::vector<PosePrior> poses;
    std::vector<PositionPrior> positions;
  };

  const PoseGraph& whole_;
  RecordingOrder order_;
  PoseGraph prefix_;
  std::vector<Priors> priors_of_;
  std::vector<std::uint32_t> index_of_point_;  // in the prefix
};

}  // namespace

void PlaceByPrefixes(std::size_t batch_count, PoseGraph& graph) {
  LOCI_CHECK(batch_count > 0);
  LOCI_CHECK(graph.joint_constraints.empty());
  PrefixGraph prefix(graph);
  bool closed_loop = false;
  while (prefix.size() < graph.map_from_node.size()) {
    closed_loop = prefix.AddNode() || closed_loop;
    if (closed_loop && prefix.size() % batch_count == 0) {
      prefix.Optimize();
      closed_loop = false;
    }
  }
  prefix.CopyTo(graph);
}

}  // namespace loci
