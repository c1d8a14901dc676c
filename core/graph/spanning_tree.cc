// SPDX-License-Identifier: Apache-2.0
// Prim's and Dijkstra's trees.
#include "core/graph/spanning_tree.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <queue>
#include <tuple>

namespace loci {
namespace {

// A constraint without information in a direction says as little there as this part of the best
// one says.
constexpr double kInformationMinRelative = 1e-9;

std::vector<std::vector<std::uint32_t>> ConstraintsOfNodes(const PoseGraph& graph) {
  std::vector<std::vector<std::uint32_t>> result(graph.map_from_node.size());
  for (std::uint32_t i = 0; i < graph.constraints.size(); ++i) {
    result[graph.constraints[i].from].push_back(i);
    result[graph.constraints[i].to].push_back(i);
  }
  return result;
}

// Grows the tree from all roots at once, always by the constraint with the lowest key. With
// `add_up`, the key is the cost of the whole path.
ToroTree GrowTree(const PoseGraph& graph, const std::vector<double>& costs, bool add_up) {
  using Entry = std::tuple<double, std::uint32_t, std::uint32_t>;  // key, constraint, node below
  const std::size_t count = graph.map_from_node.size();
  const std::vector<std::vector<std::uint32_t>> constraints_of = ConstraintsOfNodes(graph);
  ToroTree tree;
  tree.parent.assign(count, ToroTree::kNone);
  tree.parent_constraint.assign(count, ToroTree::kNone);
  tree.depth.assign(count, 0);
  tree.order.reserve(count);
  std::vector<bool> reached(count);
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> waiting;
  const auto reach = [&](std::uint32_t node, double key) {
    reached[node] = true;
    tree.order.push_back(node);
    for (const std::uint32_t i : constraints_of[node]) {
      const GraphConstraint& constraint = graph.constraints[i];
      const std::uint32_t other = constraint.from == node ? constraint.to : constraint.from;
      if (!reached[other]) {
        waiting.emplace((add_up ? key : 0.0) + costs[i], i, other);
      }
    }
  };
  const auto grow = [&] {
    while (!waiting.empty()) {
      const auto [key, i, node] = waiting.top();
      waiting.pop();
      if (reached[node]) {
        continue;
      }
      const GraphConstraint& constraint = graph.constraints[i];
      tree.parent[node] = constraint.from == node ? constraint.to : constraint.from;
      tree.parent_constraint[node] = i;
      tree.depth[node] = tree.depth[tree.parent[node]] + 1;
      reach(node, key);
    }
  };
  const std::vector<bool> held = HeldNodes(graph);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (held[i]) {
      reach(i, 0.0);
    }
  }
  grow();
  for (std::uint32_t i = 0; i < count; ++i) {
    if (!reached[i]) {
      reach(i, 0.0);
      grow();
    }
  }
  return tree;
}

// `weights` of position and of turn, per constraint; 1 / m^2 and 1 / rad^2.
std::vector<double> CostsOf(const std::vector<double>& position_weights,
                            const std::vector<double>& turn_weights,
                            double acting_squared_m2) {
  const auto floor_of = [](const std::vector<double>& weights) {
    const double largest =
        weights.empty() ? 0.0 : *std::max_element(weights.begin(), weights.end());
    return largest > 0.0 ? kInformationMinRelative * largest : 1.0;
  };
  const double position_floor = floor_of(position_weights);
  const double turn_floor = floor_of(turn_weights);
  std::vector<double> costs(position_weights.size());
  for (std::size_t i = 0; i < costs.size(); ++i) {
    costs[i] = 1.0 / std::max(position_weights[i], position_floor) +
               acting_squared_m2 / std::max(turn_weights[i], turn_floor);
  }
  return costs;
}

}  // namespace

ToroTree MinimumSpanningTree(const PoseGraph& graph, const std::vector<double>& costs) {
  return GrowTree(graph, costs, /*add_up=*/false);
}

ToroTree ShortestPathTree(const PoseGraph& graph, const std::vector<double>& costs) {
  return GrowTree(graph, costs, /*add_up=*/true);
}

std::vector<double> StepCosts(const PoseGraph& graph) {
  std::vector<double> costs;
  costs.reserve(graph.constraints.size());
  for (const GraphConstraint& constraint : graph.constraints) {
    costs.push_back(std::max(constraint.from, constraint.to) -
                    std::min(constraint.from, constraint.to));
  }
  return costs;
}

std::vector<double> UncertaintyCosts(const PoseGraph& graph) {
  std::vector<double> position_weights;
  std::vector<double> turn_weights;
  double squared_lengths = 0.0;
  for (const GraphConstraint& constraint : graph.constraints) {
    position_weights.push_back(0.5 * constraint.information.topLeftCorner<2, 2>().trace());
    turn_weights.push_back(constraint.information(2, 2));
    squared_lengths += constraint.from_from_to.translation().squaredNorm();
  }
  return CostsOf(position_weights,
                 turn_weights,
                 squared_lengths * static_cast<double>(graph.map_from_node.size()) /
                     static_cast<double>(std::max<std::size_t>(graph.constraints.size(), 1)));
}

// The turn's error is the vector part of a quaternion, half the angle.
std::vector<double> UncertaintyCosts(const SpaceGraph& graph) {
  std::vector<double> position_weights;
  std::vector<double> turn_weights;
  double squared_lengths = 0.0;
  for (const SpaceConstraint& constraint : graph.constraints) {
    position_weights.push_back(constraint.information.topLeftCorner<3, 3>().trace() / 3.0);
    turn_weights.push_back(0.25 * constraint.information.bottomRightCorner<3, 3>().trace() / 3.0);
    squared_lengths += constraint.from_from_to.translation.squaredNorm();
  }
  return CostsOf(position_weights,
                 turn_weights,
                 squared_lengths * static_cast<double>(graph.map_from_node.size()) /
                     static_cast<double>(std::max<std::size_t>(graph.constraints.size(), 1)));
}

}  // namespace loci
