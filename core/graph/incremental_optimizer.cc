// SPDX-License-Identifier: Apache-2.0
#include "core/graph/incremental_optimizer.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/check.h"
#include "core/graph/plane_problem.h"

namespace loci {
namespace {

constexpr std::uint32_t kNone = EliminationTree::kNone;

// Writes a pair's quadratic term: H = J^T W J, b = -J^T W e; a block that is held is left out.
template <int kError, int kSizeA, int kSizeB>
void WriteTerm(const LinearisedPair<kError, kSizeA, kSizeB>& linearised,
               const Eigen::Matrix<double, kError, kError>& weight,
               bool has_a,
               bool has_b,
               double* values) {
  constexpr int kSize = kSizeA + kSizeB;
  Eigen::Matrix<double, kError, kSize> jacobian;
  jacobian << linearised.jacobian_a, linearised.jacobian_b;
  const Eigen::Matrix<double, kSize, kError> weighted = jacobian.transpose() * weight;
  const Eigen::Matrix<double, kSize, kSize> h = weighted * jacobian;
  const Eigen::Matrix<double, kSize, 1> b = -(weighted * linearised.error);
  const int begin = has_a ? 0 : kSizeA;
  const int end = has_b ? kSize : kSizeA;
  const int stride = end - begin + 1;
  for (int column = begin; column < end; ++column) {
    double* to = values + static_cast<std::ptrdiff_t>(column - begin) * stride;
    for (int row = column; row < end; ++row) {
      to[row - begin] = h(row, column);
    }
    to[end - begin] = b(column);
  }
}

}  // namespace

IncrementalOptimizer::IncrementalOptimizer(const IncrementalOptions& options) : options_(options) {}

std::uint32_t IncrementalOptimizer::AddNode(const Pose2& map_from_node, bool fixed) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  nodes_.back().linearised = map_from_node;
  nodes_.back().fixed = fixed;
  graph_.map_from_node.push_back(map_from_node);
  graph_.fixed.push_back(fixed);
  return index;
}

std::uint32_t IncrementalOptimizer::AddPoint(const Eigen::Vector2d& point_in_map) {
  const auto index = static_cast<std::uint32_t>(points_.size());
  points_.emplace_back();
  graph_.points_in_map.push_back(point_in_map);
  return index;
}

std::uint32_t IncrementalOptimizer::AddConstraint(const GraphConstraint& constraint) {
  const auto index = static_cast<std::uint32_t>(graph_.constraints.size());
  graph_.constraints.push_back(constraint);
  recent_.clear();
  std::array<std::uint32_t, 2> variables{};
  std::size_t count = 0;
  for (const std::uint32_t node : {constraint.from, constraint.to}) {
    if (node != 0 && nodes_[node].variable == kNone) {
      nodes_[node].variable = tree_.AddVariable(3);
      owners_.push_back({node, false});
    }
    nodes_[node].constraints.push_back(index);
    if (nodes_[node].variable != kNone) {
      variables[count++] = nodes_[node].variable;
      recent_.push_back(nodes_[node].variable);
    }
  }
  pose_terms_.push_back(tree_.AddTerm({variables.data(), count}));
  SetPoseTerm(index);
  return index;
}

void IncrementalOptimizer::SetPoseTerm(std::uint32_t index) {
  const GraphConstraint& constraint = graph_.constraints[index];
  const auto linearised = Linearised(graph_, constraint);
  const double chi2 = linearised.error.dot(constraint.information * linearised.error);
  const double weight = constraint.robust ? options_.kernel.Weight(chi2) : 1.0;
  WriteTerm<3, 3, 3>(linearised,
                     weight * constraint.information,
                     nodes_[constraint.from].variable != kNone,
                     nodes_[constraint.to].variable != kNone,
                     tree_.SetTerm(pose_terms_[index]));
}

bool IncrementalOptimizer::HasMoved(std::uint32_t variable) const {
  const double* value = tree_.Value(variable);
  return std::abs(value[0]) > options_.relinearise_m ||
         std::abs(value[1]) > options_.relinearise_m ||
         (!owners_[variable].is_point && std::abs(value[2]) > options_.relinearise_rad);
}

void IncrementalOptimizer::Relinearise(const std::vector<std::uint32_t>& variables) {
  std::vector<std::uint32_t> constraints;
  for (const std::uint32_t variable : variables) {
    const Owner owner = owners_[variable];
    graph_.map_from_node[owner.index] = map_from_node(owner.index);
    tree_.ResetValue(variable);
    const Node& node = nodes_[owner.index];
    constraints.insert(constraints.end(), node.constraints.begin(), node.constraints.end());
  }
  std::sort(constraints.begin(), constraints.end());
  constraints.erase(std::unique(constraints.begin(), constraints.end()), constraints.end());
  for (const std::uint32_t constraint : constraints) {
    SetPoseTerm(constraint);
  }
}

Pose2 IncrementalOptimizer::map_from_node(std::uint32_t node) const {
  const Pose2& linearised = graph_.map_from_node[node];
  if (nodes_[node].variable == kNone) {
    return linearised;
  }
  const double* xi = tree_.Value(nodes_[node].variable);
  return linearised * Pose2{xi[0], xi[1], WrapAngle(xi[2])};
}

UpdateSummary IncrementalOptimizer::Update() {
  UpdateSummary summary;
  for (summary.iterations = 0; summary.iterations < options_.iterations_max;) {
    if (!tree_.Eliminate(recent_)) {
      summary.determined = false;
      return summary;
    }
    ++summary.iterations;
    summary.eliminated += tree_.eliminated_count();
    solved_.clear();
    tree_.Solve(options_.step_min, solved_);
    std::erase_if(solved_, [this](std::uint32_t variable) { return !HasMoved(variable); });
    if (solved_.empty()) {
      summary.converged = true;
      break;
    }
    std::sort(solved_.begin(), solved_.end());
    summary.relinearised += solved_.size();
    Relinearise(solved_);
  }
  return summary;
}

PoseGraph IncrementalOptimizer::Graph() const {
  PoseGraph graph = graph_;
  for (std::uint32_t node = 0; node < nodes_.size(); ++node) {
    graph.map_from_node[node] = map_from_node(node);
  }
  return graph;
}

}  // namespace loci
