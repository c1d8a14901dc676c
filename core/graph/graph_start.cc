// SPDX-License-Identifier: Apache-2.0
// Tree, sweeps and prefixes.
#include "core/graph/graph_start.h"

#include <algorithm>
#include <vector>

#include "core/graph/sparse_optimizer.h"
#include "core/graph/toro_optimizer.h"
#include "core/graph/toro_tree.h"

namespace loci {
namespace {

// Ten sweeps take most of what descent can take; Gauss-Newton is cheaper from there.
constexpr int kSweeps = 10;
// A prefix need not be exact, only right: the next one moves it again.
constexpr int kPrefixIterationsMax = 20;
constexpr double kPrefixGainMin = 1e-4;
// As many optimisations as this, at least 50 nodes apart.
constexpr std::size_t kPrefixes = 40;
constexpr std::size_t kPrefixNodesMin = 50;

// Grows a graph node by node.
class PrefixGraph {
 public:
  explicit PrefixGraph(const PoseGraph& whole)
      : whole_(whole),
        constraints_of_(whole.map_from_node.size()),
        point_constraints_of_(whole.map_from_node.size()),
        index_of_point_(whole.points_in_map.size(), kAbsent) {
    for (std::uint32_t i = 0; i < whole.constraints.size(); ++i) {
      const GraphConstraint& constraint = whole.constraints[i];
      constraints_of_[std::max(constraint.from, constraint.to)].push_back(i);
    }
    for (std::uint32_t i = 0; i < whole.point_constraints.size(); ++i) {
      point_constraints_of_[whole.point_constraints[i].from].push_back(i);
    }
  }

  std::size_t size() const { return prefix_.map_from_node.size(); }

  // Adds the next node. Returns true if it closes a loop.
  bool AddNode() {
    const auto node = static_cast<std::uint32_t>(size());
    const std::vector<std::uint32_t>& constraints = constraints_of_[node];
    prefix_.map_from_node.push_back(whole_.IsFixed(node) || constraints.empty()
                                        ? whole_.map_from_node[node]
                                        : PlacedBy(whole_.constraints[constraints.front()], node));
    prefix_.fixed.push_back(whole_.IsFixed(node));
    for (const std::uint32_t i : constraints) {
      prefix_.constraints.push_back(whole_.constraints[i]);
    }
    bool closes_loop = constraints.size() > 1;
    for (const std::uint32_t i : point_constraints_of_[node]) {
      closes_loop = AddPointConstraint(whole_.point_constraints[i]) || closes_loop;
    }
    return closes_loop;
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

  Pose2 PlacedBy(const GraphConstraint& constraint, std::uint32_t node) const {
    return constraint.to == node
               ? prefix_.map_from_node[constraint.from] * constraint.from_from_to
               : prefix_.map_from_node[constraint.to] * Inverse(constraint.from_from_to);
  }

  bool AddPointConstraint(PointConstraint constraint) {
    std::uint32_t& index = index_of_point_[constraint.point];
    const bool seen_before = index != kAbsent;
    if (!seen_before) {
      index = static_cast<std::uint32_t>(prefix_.points_in_map.size());
      prefix_.points_in_map.push_back(prefix_.map_from_node[constraint.from] *
                                      constraint.point_in_from);
    }
    constraint.point = index;
    prefix_.point_constraints.push_back(constraint);
    return seen_before;
  }

  const PoseGraph& whole_;
  PoseGraph prefix_;
  std::vector<std::vector<std::uint32_t>> constraints_of_;  // by the later of their nodes
  std::vector<std::vector<std::uint32_t>> point_constraints_of_;
  std::vector<std::uint32_t> index_of_point_;  // in the prefix
};

}  // namespace

std::string_view GraphStartName(GraphStart start) {
  switch (start) {
    case GraphStart::kGiven:
      return "given";
    case GraphStart::kTree:
      return "tree";
    case GraphStart::kSwept:
      return "swept";
    case GraphStart::kPrefixes:
      return "prefixes";
  }
  return "given";
}

void PlaceByPrefixes(std::size_t batch_count, PoseGraph& graph) {
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

void PlaceAtStart(GraphStart start, PoseGraph& graph) {
  switch (start) {
    case GraphStart::kGiven:
      return;
    case GraphStart::kTree:
      PlaceByTree(BreadthFirstTree(graph), graph);
      return;
    case GraphStart::kSwept: {
      PlaceByTree(BreadthFirstTree(graph), graph);
      ToroOptimizer toro(graph);
      for (int i = 0; i < kSweeps; ++i) {
        toro.Sweep();
      }
      graph.map_from_node = toro.Poses();
      PlacePoints(graph);
      return;
    }
    case GraphStart::kPrefixes:
      PlaceByPrefixes(std::max(kPrefixNodesMin, graph.map_from_node.size() / kPrefixes), graph);
      return;
  }
}

}  // namespace loci
