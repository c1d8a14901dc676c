// SPDX-License-Identifier: Apache-2.0
// Which nodes constraints join, and what becomes of them when that changes.
#include <algorithm>
#include <set>
#include <unordered_set>

#include "core/graph/incremental_optimizer.h"

namespace loci {

std::uint32_t IncrementalOptimizer::FindRoot(std::uint32_t node) {
  while (components_[node].parent != node) {
    components_[node].parent = components_[components_[node].parent].parent;
    node = components_[node].parent;
  }
  return node;
}

// Makes one component of the two that the ends of a new constraint belong to. The one that gives
// way moves as a whole, if the constraint says where to.
void IncrementalOptimizer::Join(std::uint32_t from, std::uint32_t to, const Pose2* from_from_to) {
  const std::uint32_t root_of_from = FindRoot(from);
  const std::uint32_t root_of_to = FindRoot(to);
  if (root_of_from == root_of_to) {
    return;
  }
  const Component& a = components_[root_of_from];
  const Component& b = components_[root_of_to];
  const bool from_stays = (a.fixed > 0) != (b.fixed > 0) ? a.fixed > 0 : a.lowest < b.lowest;
  const std::uint32_t stays = from_stays ? root_of_from : root_of_to;
  const std::uint32_t moves = from_stays ? root_of_to : root_of_from;
  if (components_[moves].fixed == 0) {
    if (from_from_to != nullptr) {
      const std::uint32_t moved_end = from_stays ? to : from;
      const Pose2 map_from_end = from_stays ? map_from_node(from) * *from_from_to
                                            : map_from_node(to) * Inverse(*from_from_to);
      MoveTogether(ConnectedTo(moved_end), map_from_end * Inverse(map_from_node(moved_end)));
    }
    Release(components_[moves].lowest);
  }
  components_[moves].parent = stays;
  components_[stays].lowest = std::min(components_[stays].lowest, components_[moves].lowest);
  components_[stays].fixed += components_[moves].fixed;
}

// Breadth first, from one node to all that it is connected to.
class IncrementalOptimizer::Search {
 public:
  Search(const IncrementalOptimizer& optimizer, std::uint32_t node)
      : optimizer_(optimizer), found_{node}, seen_{node} {}

  bool is_done() const { return next_ == found_.size(); }
  bool HasFound(std::uint32_t node) const { return seen_.contains(node); }
  const std::vector<std::uint32_t>& found() const { return found_; }  // in the order of the search

  // Goes on from the next node that has been found; calls `on_found` for each new one.
  template <typename OnFound>
  void Advance(const OnFound& on_found) {
    const auto reach = [&](std::uint32_t other) {
      if (seen_.insert(other).second) {
        found_.push_back(other);
        on_found(other);
      }
    };
    const PoseGraph& graph = optimizer_.graph_;
    const Node& node = optimizer_.nodes_[found_[next_++]];
    for (const std::uint32_t index : node.constraints) {
      reach(graph.constraints[index].from);
      reach(graph.constraints[index].to);
    }
    for (const std::uint32_t index : node.joints) {
      const std::vector<std::uint32_t>& joined = graph.joint_constraints[index].nodes;
      std::for_each(joined.begin(), joined.end(), reach);
    }
    for (const std::uint32_t index : node.point_constraints) {
      const std::uint32_t point = graph.point_constraints[index].point;
      if (points_.insert(point).second) {
        for (const std::uint32_t other : optimizer_.points_[point].point_constraints) {
          reach(graph.point_constraints[other].from);
        }
      }
    }
  }

 private:
  const IncrementalOptimizer& optimizer_;
  std::vector<std::uint32_t> found_;
  std::size_t next_ = 0;
  std::unordered_set<std::uint32_t> seen_;
  std::unordered_set<std::uint32_t> points_;
};

// All nodes of a component, ascending.
std::vector<std::uint32_t> IncrementalOptimizer::ConnectedTo(std::uint32_t node) const {
  Search search(*this, node);
  while (!search.is_done()) {
    search.Advance([](std::uint32_t) {});
  }
  std::vector<std::uint32_t> found = search.found();
  std::sort(found.begin(), found.end());
  return found;
}

// From both in turn: the ends of a constraint are near each other, if others join them, and of two
// parts that have come apart the smaller one says so.
bool IncrementalOptimizer::AreConnected(std::uint32_t a, std::uint32_t b) const {
  if (a == b) {
    return true;
  }
  Search from_a(*this, a);
  Search from_b(*this, b);
  bool met = false;
  while (!met && !from_a.is_done() && !from_b.is_done()) {
    from_a.Advance([&](std::uint32_t node) { met = met || from_b.HasFound(node); });
    from_b.Advance([&](std::uint32_t node) { met = met || from_a.HasFound(node); });
  }
  return met;
}

// The ends of what has been removed.
void IncrementalOptimizer::RegroupIfApart(std::uint32_t a, std::uint32_t b) {
  if (!AreConnected(a, b)) {
    Regroup(ConnectedTo(a));
    Regroup(ConnectedTo(b));
  }
}

// Nodes that have become a component of their own.
void IncrementalOptimizer::Regroup(const std::vector<std::uint32_t>& nodes) {
  const std::uint32_t root = nodes.front();
  std::uint32_t fixed = 0;
  bool any_held = false;
  for (const std::uint32_t node : nodes) {
    components_[node].parent = root;
    fixed += graph_.fixed[node] ? 1U : 0U;
    any_held = any_held || nodes_[node].held;
  }
  components_[root] = {root, root, fixed};
  if (!any_held) {
    Hold(root);
  }
}

// Terms between poses say the same wherever these are together; those with points do not.
void IncrementalOptimizer::MoveTogether(const std::vector<std::uint32_t>& nodes,
                                        const Pose2& map_from_old) {
  std::set<std::uint32_t> points;
  for (const std::uint32_t node : nodes) {
    graph_.map_from_node[node] = map_from_old * graph_.map_from_node[node];
    RememberMoved(node);
    for (const std::uint32_t index : nodes_[node].point_constraints) {
      points.insert(graph_.point_constraints[index].point);
    }
  }
  for (const std::uint32_t point : points) {
    Settle(points_[point].variable);
    graph_.points_in_map[point] = map_from_old * graph_.points_in_map[point];
    for (const std::uint32_t index : points_[point].point_constraints) {
      SetPointTerm(index);
    }
  }
}

}  // namespace loci
