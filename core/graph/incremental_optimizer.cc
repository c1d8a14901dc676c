// SPDX-License-Identifier: Apache-2.0
#include "core/graph/incremental_optimizer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

#include "core/base/check.h"
#include "core/graph/joint_constraint.h"
#include "core/graph/plane_problem.h"
#include "core/graph/relative_covariance.h"

namespace loci {
namespace {

// Nodes of the last constraints that are eliminated last, since the next ones will concern them.
constexpr std::size_t kRecentMax = 32;

std::string NameOf(std::uint32_t node) {
  return "node " + std::to_string(node);
}

template <typename Visit>
void ForEachOnce(std::vector<std::uint32_t>& indices, const Visit& visit) {
  std::sort(indices.begin(), indices.end());
  indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
  std::for_each(indices.begin(), indices.end(), visit);
}

template <typename Constraint>
void AppendRobust(const std::vector<std::uint32_t>& indices,
                  const std::vector<Constraint>& constraints,
                  std::vector<std::uint32_t>& robust) {
  std::copy_if(indices.begin(), indices.end(), std::back_inserter(robust), [&](std::uint32_t i) {
    return constraints[i].robust;
  });
}

}  // namespace

IncrementalOptimizer::IncrementalOptimizer(const IncrementalOptions& options) : options_(options) {}

std::uint32_t IncrementalOptimizer::AddVariable(int size, Owner owner) {
  const std::uint32_t variable = tree_.AddVariable(size);
  owners_.resize(std::max<std::size_t>(owners_.size(), variable + 1));
  owners_[variable] = owner;
  return variable;
}

void IncrementalOptimizer::RemoveVariable(std::uint32_t variable) {
  std::erase(recent_, variable);
  tree_.RemoveVariable(variable);
}

std::uint32_t IncrementalOptimizer::AddNode(const Pose2& map_from_node, bool fixed) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  has_moved_.push_back(false);
  components_.push_back({index, index, fixed ? 1U : 0U});
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

void IncrementalOptimizer::Load(const PoseGraph& graph) {
  LOCI_CHECK(nodes_.empty() && points_.empty());
  LOCI_CHECK(graph.pose_priors.empty() && graph.position_priors.empty() &&
             graph.fixed_points.empty());
  for (std::size_t node = 0; node < graph.map_from_node.size(); ++node) {
    AddNode(graph.map_from_node[node], graph.IsFixed(node));
  }
  for (const Eigen::Vector2d& point : graph.points_in_map) {
    AddPoint(point);
  }
  const auto weight_of = [&](const auto& constraint) {
    return constraint.robust ? options_.kernel.Weight(Chi2Of(graph, constraint)) : 1.0;
  };
  for (const GraphConstraint& constraint : graph.constraints) {
    Join(constraint.from, constraint.to, nullptr);
    Append(constraint, weight_of(constraint));
  }
  for (const PointConstraint& constraint : graph.point_constraints) {
    Append(constraint, weight_of(constraint));
  }
  for (const JointConstraint& constraint : graph.joint_constraints) {
    for (const std::uint32_t node : constraint.nodes) {
      Join(constraint.nodes.front(), node, nullptr);
    }
    AddJoint(constraint);
  }
}

std::uint32_t IncrementalOptimizer::AddConstraint(const GraphConstraint& constraint) {
  LOCI_CHECK(IsThere(constraint.from) && IsThere(constraint.to));
  Join(constraint.from, constraint.to, &constraint.from_from_to);
  return Append(constraint, 1.0);
}

std::uint32_t IncrementalOptimizer::AddConstraint(const PointConstraint& constraint) {
  LOCI_CHECK(IsThere(constraint.from));
  return Append(constraint, 1.0);
}

std::uint32_t IncrementalOptimizer::Append(const GraphConstraint& constraint, double weight) {
  const auto index = static_cast<std::uint32_t>(graph_.constraints.size());
  graph_.constraints.push_back(constraint);
  states_.push_back(ConstraintState::kThere);
  weights_.push_back(weight);
  terms_.push_back(kNone);
  for (const std::uint32_t node : {constraint.from, constraint.to}) {
    nodes_[node].constraints.push_back(index);
    StiffenBy(constraint, node);
  }
  MakeTerm(index);
  recent_ = updated_ ? std::vector<std::uint32_t>() : std::move(recent_);
  updated_ = false;
  for (const std::uint32_t node : {constraint.from, constraint.to}) {
    if (!nodes_[node].held && recent_.size() < kRecentMax &&
        std::find(recent_.begin(), recent_.end(), nodes_[node].variable) == recent_.end()) {
      recent_.push_back(nodes_[node].variable);
    }
  }
  return index;
}

std::uint32_t IncrementalOptimizer::Append(const PointConstraint& constraint, double weight) {
  Point& point = points_[constraint.point];
  if (point.variable == kNone) {
    point.variable = AddVariable(2, {constraint.point, true});
  } else if (!point.point_constraints.empty()) {
    Join(graph_.point_constraints[point.point_constraints.front()].from, constraint.from, nullptr);
  }
  const auto index = static_cast<std::uint32_t>(graph_.point_constraints.size());
  graph_.point_constraints.push_back(constraint);
  point.point_constraints.push_back(index);
  nodes_[constraint.from].point_constraints.push_back(index);
  StiffenBy(constraint);
  point_weights_.push_back(weight);
  point_terms_.push_back(kNone);
  point_removed_.push_back(false);
  MakePointTerm(index);
  return index;
}

void IncrementalOptimizer::AddConstraint(const JointConstraint& constraint) {
  LOCI_CHECK(std::all_of(constraint.nodes.begin(),
                         constraint.nodes.end(),
                         [this](std::uint32_t node) { return IsThere(node); }));
  for (std::size_t i = 1; i < constraint.nodes.size(); ++i) {
    Join(constraint.nodes.front(), constraint.nodes[i], &constraint.first_from_node[i - 1]);
  }
  AddJoint(constraint);
}

void IncrementalOptimizer::Detach(std::uint32_t index, ConstraintState state) {
  const GraphConstraint& constraint = graph_.constraints[index];
  states_[index] = state;
  for (const std::uint32_t node : {constraint.from, constraint.to}) {
    std::erase(nodes_[node].constraints, index);
    StiffenAnew(node);
  }
  if (terms_[index] != kNone) {
    tree_.RemoveTerm(std::exchange(terms_[index], kNone));
  }
}

Status IncrementalOptimizer::RemoveConstraint(std::uint32_t index) {
  const std::string name = "constraint " + std::to_string(index);
  if (index >= states_.size() || states_[index] == ConstraintState::kRemoved) {
    return NotFoundError(name + ": is not there");
  }
  const GraphConstraint& constraint = graph_.constraints[index];
  if (states_[index] == ConstraintState::kMarginalised) {
    const bool is_from = nodes_[constraint.from].marginalised;
    return FailedPreconditionError(name + ": " + NameOf(is_from ? constraint.from : constraint.to) +
                                   " has been marginalised");
  }
  Detach(index, ConstraintState::kRemoved);
  RegroupIfApart(constraint.from, constraint.to);
  return {};
}

Status IncrementalOptimizer::RemovePointConstraint(std::uint32_t index) {
  if (index >= point_removed_.size() || point_removed_[index]) {
    return NotFoundError("point constraint " + std::to_string(index) + ": is not there");
  }
  const PointConstraint& constraint = graph_.point_constraints[index];
  Point& point = points_[constraint.point];
  point_removed_[index] = true;
  std::erase(nodes_[constraint.from].point_constraints, index);
  StiffenAnew(constraint.from);
  std::erase(point.point_constraints, index);
  tree_.RemoveTerm(std::exchange(point_terms_[index], kNone));
  if (point.point_constraints.empty()) {
    Settle(point.variable);
    RemoveVariable(std::exchange(point.variable, kNone));
  } else {
    RegroupIfApart(constraint.from, graph_.point_constraints[point.point_constraints.front()].from);
  }
  return {};
}

void IncrementalOptimizer::Hold(std::uint32_t index) {
  Node& node = nodes_[index];
  Settle(node.variable);
  node.held = true;
  RemakeTermsOf(index);
  RemoveVariable(std::exchange(node.variable, kNone));
}

void IncrementalOptimizer::Release(std::uint32_t index) {
  Node& node = nodes_[index];
  node.variable = AddVariable(3, {index, false});
  node.held = false;
  RemakeTermsOf(index);
}

void IncrementalOptimizer::RemakeTermsOf(std::uint32_t node) {
  for (const std::uint32_t index : nodes_[node].constraints) {
    MakeTerm(index);
  }
  for (const std::uint32_t index : nodes_[node].point_constraints) {
    MakePointTerm(index);
  }
  for (const std::uint32_t index : nodes_[node].joints) {
    MakeJointTerm(index);
  }
}

void IncrementalOptimizer::MakeTerm(std::uint32_t index) {
  if (terms_[index] != kNone) {
    tree_.RemoveTerm(std::exchange(terms_[index], kNone));
  }
  const GraphConstraint& constraint = graph_.constraints[index];
  std::array<std::uint32_t, 2> variables{};
  std::size_t count = 0;
  for (const std::uint32_t node : {constraint.from, constraint.to}) {
    if (!nodes_[node].held) {
      variables[count++] = nodes_[node].variable;
    }
  }
  if (count > 0) {
    terms_[index] = tree_.AddTerm(std::span(variables).first(count));
    SetTerm(index);
  }
}

void IncrementalOptimizer::MakePointTerm(std::uint32_t index) {
  if (point_terms_[index] != kNone) {
    tree_.RemoveTerm(point_terms_[index]);
  }
  const PointConstraint& constraint = graph_.point_constraints[index];
  const Node& node = nodes_[constraint.from];
  const std::array<std::uint32_t, 2> variables{node.variable, points_[constraint.point].variable};
  point_terms_[index] = tree_.AddTerm(std::span(variables).subspan(node.held ? 1 : 0));
  SetPointTerm(index);
}

void IncrementalOptimizer::SetTerm(std::uint32_t index) {
  if (terms_[index] != kNone) {
    const GraphConstraint& constraint = graph_.constraints[index];
    WriteConstraint(constraint, weights_[index], !nodes_[constraint.to].held, terms_[index]);
  }
}

void IncrementalOptimizer::SetPointTerm(std::uint32_t index) {
  WriteConstraint(
      graph_.point_constraints[index], point_weights_[index], true, point_terms_[index]);
}

// As it is at the present linearisation.
template <typename Constraint>
void IncrementalOptimizer::WriteConstraint(const Constraint& constraint,
                                           double weight,
                                           bool second_is_free,
                                           std::uint32_t term) {
  WriteTerm(Linearised(graph_, constraint),
            (weight * constraint.information).eval(),
            !nodes_[constraint.from].held,
            second_is_free,
            tree_.SetTerm(term));
}

// Linearisation at the present value, which is 0 from there. Its terms must be set after that.
void IncrementalOptimizer::Settle(std::uint32_t variable) {
  const Owner owner = owners_[variable];
  if (owner.is_point) {
    graph_.points_in_map[owner.index] = point_in_map(owner.index);
  } else {
    graph_.map_from_node[owner.index] = map_from_node(owner.index);
  }
  tree_.ResetValue(variable);
}

void IncrementalOptimizer::Stiffen(std::uint32_t node,
                                   double information_per_m2,
                                   const Eigen::Vector2d& reach) {
  nodes_[node].stiffness = std::max(nodes_[node].stiffness, std::sqrt(information_per_m2));
  nodes_[node].reach_m = std::max(nodes_[node].reach_m, reach.norm());
}

void IncrementalOptimizer::StiffenBy(const GraphConstraint& constraint, std::uint32_t node) {
  Stiffen(node,
          constraint.information.topLeftCorner<2, 2>().trace(),
          constraint.from_from_to.translation());
}

void IncrementalOptimizer::StiffenBy(const PointConstraint& constraint) {
  Stiffen(constraint.from, constraint.information.trace(), constraint.point_in_from);
}

// By what the constraint says of nodes[i], i > 0.
void IncrementalOptimizer::StiffenBy(const JointConstraint& constraint,
                                     std::size_t i,
                                     std::uint32_t node) {
  const auto at = 3 * static_cast<Eigen::Index>(i - 1);
  Stiffen(node,
          constraint.information.block<2, 2>(at, at).trace(),
          constraint.first_from_node[i - 1].translation());
}

// From the constraints that it still has.
void IncrementalOptimizer::StiffenAnew(std::uint32_t node) {
  nodes_[node].stiffness = 0.0;
  nodes_[node].reach_m = 0.0;
  for (const std::uint32_t index : nodes_[node].constraints) {
    StiffenBy(graph_.constraints[index], node);
  }
  for (const std::uint32_t index : nodes_[node].point_constraints) {
    StiffenBy(graph_.point_constraints[index]);
  }
  for (const std::uint32_t index : nodes_[node].joints) {
    const JointConstraint& joint = graph_.joint_constraints[index];
    for (std::size_t i = 1; i < joint.nodes.size(); ++i) {
      if (joint.nodes[i] == node || joint.nodes[0] == node) {
        StiffenBy(joint, i, node);
      }
    }
  }
}

bool IncrementalOptimizer::HasMoved(std::uint32_t variable) const {
  const double* value = tree_.Value(variable);
  if (std::abs(value[0]) > options_.relinearise_m || std::abs(value[1]) > options_.relinearise_m) {
    return true;
  }
  if (owners_[variable].is_point) {
    return false;
  }
  // A turn bends what is a straight line to the linearisation: that of a constraint's end, by half
  // its square, and that of the node's own shift.
  const Node& node = nodes_[owners_[variable].index];
  const double turn = std::abs(value[2]);
  const double neglected_m = turn * (0.5 * turn * node.reach_m + std::hypot(value[0], value[1]));
  return turn > options_.relinearise_rad ||
         neglected_m * node.stiffness > options_.relinearise_sigma;
}

void IncrementalOptimizer::Relinearise(std::vector<std::uint32_t>& variables) {
  std::sort(variables.begin(), variables.end());
  std::vector<std::uint32_t> constraints;
  std::vector<std::uint32_t> point_constraints;
  std::vector<std::uint32_t> joints;
  for (const std::uint32_t variable : variables) {
    Settle(variable);
    const Owner owner = owners_[variable];
    const std::vector<std::uint32_t>& of_points = owner.is_point
                                                      ? points_[owner.index].point_constraints
                                                      : nodes_[owner.index].point_constraints;
    point_constraints.insert(point_constraints.end(), of_points.begin(), of_points.end());
    if (!owner.is_point) {
      const std::vector<std::uint32_t>& of_poses = nodes_[owner.index].constraints;
      constraints.insert(constraints.end(), of_poses.begin(), of_poses.end());
      const std::vector<std::uint32_t>& of_many = nodes_[owner.index].joints;
      joints.insert(joints.end(), of_many.begin(), of_many.end());
    }
  }
  ForEachOnce(constraints, [this](std::uint32_t index) { SetTerm(index); });
  ForEachOnce(point_constraints, [this](std::uint32_t index) { SetPointTerm(index); });
  ForEachOnce(joints, [this](std::uint32_t index) { SetJointTerm(index); });
}

Pose2 IncrementalOptimizer::map_from_node(std::uint32_t node) const {
  const Pose2& linearised = graph_.map_from_node[node];
  if (nodes_[node].held) {
    return linearised;
  }
  const double* xi = tree_.Value(nodes_[node].variable);
  return linearised * Pose2{xi[0], xi[1], WrapAngle(xi[2])};
}

Eigen::Vector2d IncrementalOptimizer::point_in_map(std::uint32_t point) const {
  const Eigen::Vector2d& linearised = graph_.points_in_map[point];
  if (points_[point].variable == kNone) {
    return linearised;
  }
  const double* shift = tree_.Value(points_[point].variable);
  return linearised + Eigen::Vector2d(shift[0], shift[1]);
}

double IncrementalOptimizer::PresentWeight(std::uint32_t index) const {
  const GraphConstraint& constraint = graph_.constraints[index];
  return options_.kernel.Weight(
      Chi2Of(constraint, map_from_node(constraint.from), map_from_node(constraint.to)));
}

double IncrementalOptimizer::PresentPointWeight(std::uint32_t index) const {
  const PointConstraint& constraint = graph_.point_constraints[index];
  return options_.kernel.Weight(
      Chi2Of(constraint, map_from_node(constraint.from), point_in_map(constraint.point)));
}

// Weighs the robust constraints of what was solved anew, where that makes a difference. True if it
// does.
bool IncrementalOptimizer::Reweigh(std::span<const std::uint32_t> solved) {
  if (options_.kernel.shape == RobustKernel::Shape::kNone) {
    return false;
  }
  std::vector<std::uint32_t> constraints;
  std::vector<std::uint32_t> point_constraints;
  for (const std::uint32_t variable : solved) {
    const Owner owner = owners_[variable];
    if (owner.is_point) {
      AppendRobust(
          points_[owner.index].point_constraints, graph_.point_constraints, point_constraints);
    } else {
      AppendRobust(
          nodes_[owner.index].point_constraints, graph_.point_constraints, point_constraints);
      AppendRobust(nodes_[owner.index].constraints, graph_.constraints, constraints);
    }
  }
  bool any = false;
  const auto differs = [&](double present, double& weight) {
    const bool does = std::abs(present - weight) > options_.reweigh * weight;
    weight = does ? present : weight;
    any = any || does;
    return does;
  };
  ForEachOnce(constraints, [&](std::uint32_t index) {
    if (differs(PresentWeight(index), weights_[index])) {
      SetTerm(index);
    }
  });
  ForEachOnce(point_constraints, [&](std::uint32_t index) {
    if (differs(PresentPointWeight(index), point_weights_[index])) {
      SetPointTerm(index);
    }
  });
  return any;
}

void IncrementalOptimizer::RememberMoved(std::uint32_t node) {
  if (!has_moved_[node]) {
    has_moved_[node] = true;
    moved_nodes_.push_back(node);
  }
}

std::vector<std::uint32_t> IncrementalOptimizer::TakeMovedNodes() {
  for (const std::uint32_t node : moved_nodes_) {
    has_moved_[node] = false;
  }
  return std::exchange(moved_nodes_, {});
}

UpdateSummary IncrementalOptimizer::Update() {
  UpdateSummary summary;
  std::vector<std::uint32_t> moved;
  while (summary.iterations < options_.iterations_max) {
    if (!Factorise()) {
      summary.determined = false;
      return summary;
    }
    ++summary.iterations;
    summary.eliminated += tree_.eliminated_count();
    moved.clear();
    tree_.Solve(options_.step_min, moved);
    for (const std::uint32_t variable : moved) {
      if (!owners_[variable].is_point) {
        RememberMoved(owners_[variable].index);
      }
    }
    const bool reweighed = Reweigh(moved);
    std::erase_if(moved, [this](std::uint32_t variable) { return !HasMoved(variable); });
    if (moved.empty() && !reweighed) {
      summary.converged = true;
      break;
    }
    summary.relinearised += moved.size();
    Relinearise(moved);
  }
  return summary;
}

bool IncrementalOptimizer::Factorise() {
  updated_ = true;
  // Many are a graph that is loaded, whose order should be that of a batch.
  return tree_.Eliminate(recent_.size() < kRecentMax ? recent_ : std::vector<std::uint32_t>());
}

Eigen::Matrix3d IncrementalOptimizer::RelativeCovariance(std::uint32_t from,
                                                         std::uint32_t to) const {
  LOCI_CHECK(IsThere(from) && IsThere(to));
  return RelativeCovarianceOf(
      from,
      to,
      Inverse(map_from_node(to)) * map_from_node(from),
      kNone,
      [this](std::uint32_t node) { return nodes_[node].variable; },
      [this](std::span<const std::uint32_t> variables, const Eigen::MatrixXd& a) {
        return tree_.InverseForm(variables, a);
      });
}

PoseGraph IncrementalOptimizer::Graph() const {
  PoseGraph graph;
  graph.fixed = graph_.fixed;
  for (std::uint32_t node = 0; node < nodes_.size(); ++node) {
    graph.map_from_node.push_back(map_from_node(node));
  }
  for (std::uint32_t point = 0; point < points_.size(); ++point) {
    graph.points_in_map.push_back(point_in_map(point));
  }
  for (std::size_t i = 0; i < graph_.constraints.size(); ++i) {
    if (states_[i] == ConstraintState::kThere) {
      graph.constraints.push_back(graph_.constraints[i]);
    }
  }
  for (std::size_t i = 0; i < graph_.point_constraints.size(); ++i) {
    if (!point_removed_[i]) {
      graph.point_constraints.push_back(graph_.point_constraints[i]);
    }
  }
  for (const JointConstraint& joint : graph_.joint_constraints) {
    if (joint.nodes.size() == 2) {
      graph.constraints.push_back(PairOf(joint));
    } else if (!joint.nodes.empty()) {
      graph.joint_constraints.push_back(joint);
    }
  }
  return graph;
}

IncrementalSize IncrementalOptimizer::Size() const {
  return {tree_.variable_count(),
          tree_.term_count(),
          tree_.front_count(),
          graph_.joint_constraints.size()};
}

}  // namespace loci
