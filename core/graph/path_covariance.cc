// SPDX-License-Identifier: Apache-2.0
// Dijkstra's search, and the covariances along its paths.
#include "core/graph/path_covariance.h"

#include <algorithm>
#include <functional>
#include <limits>

#include <Eigen/Cholesky>

namespace loci {
namespace {

// An error in heading counts by what it moves at this distance: that of the loops to be closed.
constexpr double kLeverM = 10.0;
// More than what rounding can take away.
constexpr double kRoundedUp = 1.0 + 1e-9;
constexpr double kUnreached = std::numeric_limits<double>::infinity();

}  // namespace

PathCovariance::PathCovariance(const PoseGraph& graph)
    : graph_(&graph),
      covariances_(graph.constraints.size(), Eigen::Matrix3d::Zero()),
      in_map_(graph.constraints.size(), Eigen::Matrix3d::Zero()),
      lengths_(graph.constraints.size()),
      first_step_(graph.map_from_node.size() + 1),
      distance_(graph.map_from_node.size(), kUnreached),
      via_(graph.map_from_node.size()),
      is_found_(graph.map_from_node.size()) {
  for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
    const Eigen::LLT<Eigen::Matrix3d> factor(graph.constraints[i].information);
    if (factor.info() != Eigen::Success) {
      continue;
    }
    const Eigen::Matrix3d covariance = factor.solve(Eigen::Matrix3d::Identity());
    if (covariance.allFinite()) {
      covariances_[i] = 0.5 * (covariance + covariance.transpose());
      lengths_[i] = covariance(0, 0) + covariance(1, 1) + covariance(2, 2) * kLeverM * kLeverM;
    }
  }
}

// A constraint's error moves with xi on the right of its `to`, turned by the heading that the error
// has itself, so that its axes are those of `to` with the heading as measured. Moved to the left,
// errors of all constraints are in the frame of the map and can be added: map_from_to * Exp(xi) is
// Exp(Adjoint(map_from_to) * xi) * map_from_to.
void PathCovariance::Use(const std::vector<bool>& constraints) {
  std::fill(first_step_.begin(), first_step_.end(), 0U);
  const auto for_each_used = [&](auto&& body) {
    for (std::uint32_t i = 0; i < constraints.size(); ++i) {
      if (constraints[i] && lengths_[i] > 0.0) {
        body(i, graph_->constraints[i].from, graph_->constraints[i].to);
      }
    }
  };
  for_each_used([&](std::uint32_t i, std::uint32_t a, std::uint32_t b) {
    ++first_step_[a + 1];
    ++first_step_[b + 1];
    const Pose2& to = graph_->map_from_node[b];
    const double heading =
        graph_->map_from_node[a].theta + graph_->constraints[i].from_from_to.theta;
    const Eigen::Matrix3d adjoint = Adjoint({to.x, to.y, WrapAngle(heading)});
    in_map_[i] = kRoundedUp * adjoint * covariances_[i] * adjoint.transpose();
  });
  for (std::size_t i = 1; i < first_step_.size(); ++i) {
    first_step_[i] += first_step_[i - 1];
  }
  steps_.resize(first_step_.back());
  std::vector<std::uint32_t> next(first_step_.begin(), first_step_.end() - 1);
  for_each_used([&](std::uint32_t i, std::uint32_t a, std::uint32_t b) {
    steps_[next[a]++] = {b, i};
    steps_[next[b]++] = {a, i};
  });
}

void PathCovariance::Search(std::uint32_t from,
                            std::size_t nodes_max,
                            std::optional<std::uint32_t> until) {
  for (const std::uint32_t node : reached_) {
    distance_[node] = kUnreached;
    is_found_[node] = false;
  }
  found_.clear();
  reached_ = {from};
  distance_[from] = 0.0;
  frontier_ = {{0.0, from}};
  while (!frontier_.empty() && found_.size() < nodes_max) {
    std::pop_heap(frontier_.begin(), frontier_.end(), std::greater<>());
    const auto [distance, node] = frontier_.back();
    frontier_.pop_back();
    if (is_found_[node]) {
      continue;
    }
    is_found_[node] = true;
    found_.push_back(node);
    if (until == node) {
      return;
    }
    for (std::uint32_t i = first_step_[node]; i < first_step_[node + 1]; ++i) {
      const Step& step = steps_[i];
      const double further = distance + lengths_[step.constraint];
      if (further < distance_[step.to]) {
        if (distance_[step.to] == kUnreached) {
          reached_.push_back(step.to);
        }
        distance_[step.to] = further;
        via_[step.to] = step.constraint;
        frontier_.emplace_back(further, step.to);
        std::push_heap(frontier_.begin(), frontier_.end(), std::greater<>());
      }
    }
  }
}

Eigen::Matrix3d PathCovariance::CovarianceTo(std::uint32_t node) const {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::uint32_t at = node; at != found_.front();) {
    const GraphConstraint& constraint = graph_->constraints[via_[at]];
    sum += in_map_[via_[at]];
    at = constraint.to == at ? constraint.from : constraint.to;
  }
  const Eigen::Matrix3d adjoint = Adjoint(Inverse(graph_->map_from_node[node]));
  const Eigen::Matrix3d covariance = adjoint * sum * adjoint.transpose();
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace loci
