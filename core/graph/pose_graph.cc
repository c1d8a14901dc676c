// SPDX-License-Identifier: Apache-2.0
// Error, chi2, validity, order and components of a pose graph.
#include "core/graph/pose_graph.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <tuple>

#include "core/graph/information.h"

namespace loci {
namespace {

Status ValidateIndex(std::uint32_t index, std::size_t count, const std::string& field) {
  if (index >= count) {
    return InvalidArgumentError(field + ": " + std::to_string(index) + ", must be < " +
                                std::to_string(count));
  }
  return {};
}

Status ValidateConstraint(const PoseGraph& graph,
                          const GraphConstraint& constraint,
                          const std::string& name) {
  LOCI_RETURN_IF_ERROR(ValidateIndex(constraint.from, graph.map_from_node.size(), name + ".from"));
  LOCI_RETURN_IF_ERROR(ValidateIndex(constraint.to, graph.map_from_node.size(), name + ".to"));
  if (constraint.from == constraint.to) {
    return InvalidArgumentError(name + ": joins node " + std::to_string(constraint.from) +
                                " to itself");
  }
  if (!constraint.from_from_to.vector().allFinite()) {
    return InvalidArgumentError(name + ".from_from_to: a number is not finite");
  }
  return ValidateInformation(constraint.information, name + ".information");
}

Status ValidateConstraint(const PoseGraph& graph,
                          const PointConstraint& constraint,
                          const std::string& name) {
  LOCI_RETURN_IF_ERROR(ValidateIndex(constraint.from, graph.map_from_node.size(), name + ".from"));
  LOCI_RETURN_IF_ERROR(
      ValidateIndex(constraint.point, graph.points_in_map.size(), name + ".point"));
  if (!constraint.point_in_from.allFinite()) {
    return InvalidArgumentError(name + ".point_in_from: a number is not finite");
  }
  return ValidateInformation(constraint.information, name + ".information");
}

Status ValidateConstraint(const PoseGraph& graph,
                          const JointConstraint& constraint,
                          const std::string& name) {
  const std::size_t count = constraint.nodes.size();
  if (count < 2 || constraint.first_from_node.size() != count - 1) {
    return InvalidArgumentError(name + ": " + std::to_string(count) + " nodes and " +
                                std::to_string(constraint.first_from_node.size()) +
                                " poses, must be one pose less than nodes, and at least one");
  }
  std::vector<std::uint32_t> nodes = constraint.nodes;
  std::sort(nodes.begin(), nodes.end());
  LOCI_RETURN_IF_ERROR(ValidateIndex(nodes.back(), graph.map_from_node.size(), name + ".nodes"));
  const auto twice = std::adjacent_find(nodes.begin(), nodes.end());
  if (twice != nodes.end()) {
    return InvalidArgumentError(name + ": joins node " + std::to_string(*twice) + " to itself");
  }
  for (const Pose2& pose : constraint.first_from_node) {
    if (!pose.vector().allFinite()) {
      return InvalidArgumentError(name + ".first_from_node: a number is not finite");
    }
  }
  const auto size = static_cast<Eigen::Index>(3 * (count - 1));
  if (constraint.information.rows() != size || constraint.information.cols() != size) {
    return InvalidArgumentError(name +
                                ".information: " + std::to_string(constraint.information.rows()) +
                                " x " + std::to_string(constraint.information.cols()) +
                                ", must be " + std::to_string(size) + " x " + std::to_string(size));
  }
  return ValidateInformation(constraint.information, name + ".information");
}

Status ValidatePrior(const PoseGraph& graph, const PosePrior& prior, const std::string& name) {
  LOCI_RETURN_IF_ERROR(ValidateIndex(prior.node, graph.map_from_node.size(), name + ".node"));
  if (!prior.map_from_node.vector().allFinite()) {
    return InvalidArgumentError(name + ".map_from_node: a number is not finite");
  }
  return ValidateInformation(prior.information, name + ".information");
}

Status ValidatePrior(const PoseGraph& graph, const PositionPrior& prior, const std::string& name) {
  LOCI_RETURN_IF_ERROR(ValidateIndex(prior.node, graph.map_from_node.size(), name + ".node"));
  if (!prior.node_in_map.allFinite()) {
    return InvalidArgumentError(name + ".node_in_map: a number is not finite");
  }
  return ValidateInformation(prior.information, name + ".information");
}

Status ValidatePriors(const PoseGraph& graph) {
  for (std::size_t i = 0; i < graph.pose_priors.size(); ++i) {
    LOCI_RETURN_IF_ERROR(
        ValidatePrior(graph, graph.pose_priors[i], "pose_priors[" + std::to_string(i) + "]"));
  }
  for (std::size_t i = 0; i < graph.position_priors.size(); ++i) {
    LOCI_RETURN_IF_ERROR(ValidatePrior(
        graph, graph.position_priors[i], "position_priors[" + std::to_string(i) + "]"));
  }
  return {};
}

// All that tells two constraints apart, in the order in which SortConstraints compares it.
auto SortKey(const GraphConstraint& c) {
  std::array<double, 12> numbers{c.from_from_to.x, c.from_from_to.y, c.from_from_to.theta};
  std::copy_n(c.information.data(), 9, numbers.begin() + 3);
  return std::make_tuple(c.from, c.to, numbers, c.robust);
}
auto SortKey(const PointConstraint& c) {
  std::array<double, 6> numbers{c.point_in_from.x(), c.point_in_from.y()};
  std::copy_n(c.information.data(), 4, numbers.begin() + 2);
  return std::make_tuple(c.from, c.point, numbers, c.robust);
}
auto SortKey(const PosePrior& p) {
  std::array<double, 12> numbers{p.map_from_node.x, p.map_from_node.y, p.map_from_node.theta};
  std::copy_n(p.information.data(), 9, numbers.begin() + 3);
  return std::make_tuple(p.node, numbers, p.robust);
}
auto SortKey(const PositionPrior& p) {
  std::array<double, 6> numbers{p.node_in_map.x(), p.node_in_map.y()};
  std::copy_n(p.information.data(), 4, numbers.begin() + 2);
  return std::make_tuple(p.node, numbers, p.robust);
}
auto SortKey(const JointConstraint& c) {
  std::vector<double> numbers;
  for (const Pose2& pose : c.first_from_node) {
    numbers.insert(numbers.end(), {pose.x, pose.y, pose.theta});
  }
  numbers.insert(numbers.end(), c.information.data(), c.information.data() + c.information.size());
  return std::make_tuple(c.nodes, numbers);
}

template <typename Term>
void SortByKey(std::vector<Term>& terms) {
  std::sort(terms.begin(), terms.end(), [](const Term& a, const Term& b) {
    return SortKey(a) < SortKey(b);
  });
}

template <typename Term>
double SumOfChi2(const PoseGraph& graph, const std::vector<Term>& terms, double sum) {
  for (const Term& term : terms) {
    sum += Chi2Of(graph, term);
  }
  return sum;
}

template <typename Term>
std::size_t CountZero(const std::vector<Term>& terms) {
  return static_cast<std::size_t>(std::count_if(terms.begin(), terms.end(), [](const Term& term) {
    return (term.information.array() == 0.0).all();
  }));
}

// The root of `item`'s tree; halves the path on the way (union-find).
std::uint32_t FindRoot(std::vector<std::uint32_t>& parent, std::uint32_t item) {
  while (parent[item] != item) {
    parent[item] = parent[parent[item]];
    item = parent[item];
  }
  return item;
}

// Joins two trees; the lower root stays, so that a component is named by its lowest member.
void Join(std::vector<std::uint32_t>& parent, std::uint32_t a, std::uint32_t b) {
  const std::uint32_t root_a = FindRoot(parent, a);
  const std::uint32_t root_b = FindRoot(parent, b);
  parent[std::max(root_a, root_b)] = std::min(root_a, root_b);
}

Eigen::Vector3d ErrorBetween(const GraphConstraint& constraint,
                             const Pose2& map_from_from,
                             const Pose2& map_from_to) {
  const Pose2 predicted_from_from_to = Inverse(map_from_from) * map_from_to;
  return (Inverse(constraint.from_from_to) * predicted_from_from_to).vector();
}

Eigen::Vector2d ErrorBetween(const PointConstraint& constraint,
                             const Pose2& map_from_from,
                             const Eigen::Vector2d& point_in_map) {
  return Inverse(map_from_from) * point_in_map - constraint.point_in_from;
}

}  // namespace

Eigen::Vector3d ErrorOf(const PoseGraph& graph, const GraphConstraint& constraint) {
  return ErrorBetween(
      constraint, graph.map_from_node[constraint.from], graph.map_from_node[constraint.to]);
}

Eigen::Vector2d ErrorOf(const PoseGraph& graph, const PointConstraint& constraint) {
  return ErrorBetween(
      constraint, graph.map_from_node[constraint.from], graph.points_in_map[constraint.point]);
}

Eigen::Vector3d ErrorOf(const PoseGraph& graph, const PosePrior& prior) {
  return (Inverse(prior.map_from_node) * graph.map_from_node[prior.node]).vector();
}

Eigen::Vector2d ErrorOf(const PoseGraph& graph, const PositionPrior& prior) {
  return graph.map_from_node[prior.node].translation() - prior.node_in_map;
}

Eigen::VectorXd ErrorOf(const PoseGraph& graph, const JointConstraint& constraint) {
  const Pose2 first_from_map = Inverse(graph.map_from_node[constraint.nodes.front()]);
  Eigen::VectorXd error(3 * static_cast<Eigen::Index>(constraint.first_from_node.size()));
  for (std::size_t i = 0; i < constraint.first_from_node.size(); ++i) {
    const Pose2 predicted = first_from_map * graph.map_from_node[constraint.nodes[i + 1]];
    error.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        (Inverse(constraint.first_from_node[i]) * predicted).vector();
  }
  return error;
}

double Chi2Of(const PoseGraph& graph, const GraphConstraint& constraint) {
  const Eigen::Vector3d error = ErrorOf(graph, constraint);
  return error.dot(constraint.information * error);
}

double Chi2Of(const PoseGraph& graph, const PointConstraint& constraint) {
  const Eigen::Vector2d error = ErrorOf(graph, constraint);
  return error.dot(constraint.information * error);
}

double Chi2Of(const PoseGraph& graph, const PosePrior& prior) {
  const Eigen::Vector3d error = ErrorOf(graph, prior);
  return error.dot(prior.information * error);
}

double Chi2Of(const PoseGraph& graph, const PositionPrior& prior) {
  const Eigen::Vector2d error = ErrorOf(graph, prior);
  return error.dot(prior.information * error);
}

double Chi2Of(const PoseGraph& graph, const JointConstraint& constraint) {
  const Eigen::VectorXd error = ErrorOf(graph, constraint);
  return error.dot(constraint.information * error);
}

double Chi2Of(const GraphConstraint& constraint,
              const Pose2& map_from_from,
              const Pose2& map_from_to) {
  const Eigen::Vector3d error = ErrorBetween(constraint, map_from_from, map_from_to);
  return error.dot(constraint.information * error);
}

double Chi2Of(const PointConstraint& constraint,
              const Pose2& map_from_from,
              const Eigen::Vector2d& point_in_map) {
  const Eigen::Vector2d error = ErrorBetween(constraint, map_from_from, point_in_map);
  return error.dot(constraint.information * error);
}

double Chi2(const PoseGraph& graph) {
  double sum = SumOfChi2(graph, graph.constraints, 0.0);
  sum = SumOfChi2(graph, graph.point_constraints, sum);
  sum = SumOfChi2(graph, graph.pose_priors, sum);
  sum = SumOfChi2(graph, graph.position_priors, sum);
  return SumOfChi2(graph, graph.joint_constraints, sum);
}

Status ValidateGraph(const PoseGraph& graph) {
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    if (!graph.map_from_node[i].vector().allFinite()) {
      return InvalidArgumentError("map_from_node[" + std::to_string(i) +
                                  "]: a number is not finite");
    }
  }
  for (std::size_t i = 0; i < graph.points_in_map.size(); ++i) {
    if (!graph.points_in_map[i].allFinite()) {
      return InvalidArgumentError("points_in_map[" + std::to_string(i) +
                                  "]: a number is not finite");
    }
  }
  for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
    LOCI_RETURN_IF_ERROR(
        ValidateConstraint(graph, graph.constraints[i], "constraints[" + std::to_string(i) + "]"));
  }
  for (std::size_t i = 0; i < graph.point_constraints.size(); ++i) {
    LOCI_RETURN_IF_ERROR(ValidateConstraint(
        graph, graph.point_constraints[i], "point_constraints[" + std::to_string(i) + "]"));
  }
  for (std::size_t i = 0; i < graph.joint_constraints.size(); ++i) {
    LOCI_RETURN_IF_ERROR(ValidateConstraint(
        graph, graph.joint_constraints[i], "joint_constraints[" + std::to_string(i) + "]"));
  }
  return ValidatePriors(graph);
}

std::size_t CountZeroInformation(const PoseGraph& graph) {
  return CountZero(graph.constraints) + CountZero(graph.point_constraints) +
         CountZero(graph.pose_priors) + CountZero(graph.position_priors) +
         CountZero(graph.joint_constraints);
}

void SortConstraints(PoseGraph& graph) {
  SortByKey(graph.constraints);
  SortByKey(graph.point_constraints);
  SortByKey(graph.pose_priors);
  SortByKey(graph.position_priors);
  SortByKey(graph.joint_constraints);
}

GraphComponents FindComponents(const PoseGraph& graph) {
  const std::size_t node_count = graph.map_from_node.size();
  std::vector<std::uint32_t> parent(node_count + graph.points_in_map.size());
  std::iota(parent.begin(), parent.end(), 0U);
  for (const GraphConstraint& constraint : graph.constraints) {
    Join(parent, constraint.from, constraint.to);
  }
  for (const JointConstraint& constraint : graph.joint_constraints) {
    for (const std::uint32_t node : constraint.nodes) {
      Join(parent, constraint.nodes.front(), node);
    }
  }
  for (const PointConstraint& constraint : graph.point_constraints) {
    Join(parent, constraint.from, static_cast<std::uint32_t>(node_count) + constraint.point);
  }
  GraphComponents components;
  std::vector<std::uint32_t> number(parent.size());
  for (std::uint32_t i = 0; i < parent.size(); ++i) {
    const std::uint32_t root = FindRoot(parent, i);
    number[i] = root == i ? components.count++ : number[root];
  }
  const auto first_point = number.begin() + static_cast<std::ptrdiff_t>(node_count);
  components.of_node.assign(number.begin(), first_point);
  components.of_point.assign(first_point, number.end());
  return components;
}

}  // namespace loci
