// SPDX-License-Identifier: Apache-2.0
// How well a pose graph knows one node from another, from above and without a factorisation.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/se2.h"
#include "core/graph/pose_graph.h"

namespace loci {

// Compounds the covariances of the constraints along one path, the most certain one: the paths from
// one node to all others are a tree. What other paths and priors know too is left out, so that this
// is conservative: never smaller than GraphCovariance::Relative at the same poses, and the same
// where there is no other path. (Without a kernel: that takes information away.) Joint constraints
// are no part of a path. For searching candidates and for gates, where a bound does and a
// factorisation costs too much.
//
// Paths lead over the constraints that Use names, and are as certain as they are short: a step
// counts sigma_x^2 + sigma_y^2 + (sigma_theta * 10 m)^2. Constraints whose information cannot be
// inverted are passed over. Refers to a graph that lives longer and keeps its constraints; if its
// poses move, Use has to be called again.
class PathCovariance {
 public:
  static constexpr std::size_t kAllNodes = static_cast<std::size_t>(-1);

  explicit PathCovariance(const PoseGraph& graph);

  // From now on only these constraints, in the order of graph.constraints.
  void Use(const std::vector<bool>& constraints);

  // Finds the paths from `from` to its nearest `nodes_max` nodes, itself among them, or until
  // `until` is found.
  void Search(std::uint32_t from,
              std::size_t nodes_max = kAllNodes,
              std::optional<std::uint32_t> until = std::nullopt);

  // The nodes found by the last Search, nearest first.
  const std::vector<std::uint32_t>& Found() const { return found_; }
  bool IsFound(std::uint32_t node) const { return is_found_[node]; }

  // Of from_from_node = Inverse(map_from_from) * map_from_node, as from_from_node * Exp(xi). The
  // node must have been found. Costs the length of the path.
  Eigen::Matrix3d CovarianceTo(std::uint32_t node) const;

 private:
  struct Step {
    std::uint32_t to = 0;
    std::uint32_t constraint = 0;
  };

  const PoseGraph* graph_;
  std::vector<Eigen::Matrix3d> covariances_;  // per constraint, 0 where it cannot be inverted
  std::vector<Eigen::Matrix3d> in_map_;  // the same of those in use, on the left of the map's poses
  std::vector<double> lengths_;          // per constraint, 0 where it cannot be inverted
  std::vector<std::uint32_t> first_step_;  // per node, into steps_; one more at the end
  std::vector<Step> steps_;
  std::vector<double> distance_;
  std::vector<std::uint32_t> via_;  // the constraint that leads to a node
  std::vector<bool> is_found_;
  std::vector<std::uint32_t> found_;
  std::vector<std::uint32_t> reached_;                      // whose distance is set
  std::vector<std::pair<double, std::uint32_t>> frontier_;  // a heap
};

}  // namespace loci
