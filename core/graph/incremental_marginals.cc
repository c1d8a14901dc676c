// SPDX-License-Identifier: Apache-2.0
// Nodes that go while the graph is kept at its optimum, and what they leave.
#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

#include "core/graph/incremental_optimizer.h"
#include "core/graph/joint_constraint.h"

namespace loci {
namespace {

std::string NameOf(std::uint32_t node) {
  return "node " + std::to_string(node);
}

// Small graphs are cut out of the whole one: their nodes are numbered by their place in `nodes`,
// which ascend.
std::uint32_t PlaceOf(std::uint32_t node, const std::vector<std::uint32_t>& nodes) {
  return static_cast<std::uint32_t>(std::lower_bound(nodes.begin(), nodes.end(), node) -
                                    nodes.begin());
}
GraphConstraint CutOut(GraphConstraint constraint, const std::vector<std::uint32_t>& nodes) {
  constraint.from = PlaceOf(constraint.from, nodes);
  constraint.to = PlaceOf(constraint.to, nodes);
  return constraint;
}
JointConstraint CutOut(JointConstraint constraint, const std::vector<std::uint32_t>& nodes) {
  for (std::uint32_t& node : constraint.nodes) {
    node = PlaceOf(node, nodes);
  }
  return constraint;
}
JointConstraint PutBack(JointConstraint constraint, const std::vector<std::uint32_t>& nodes) {
  for (std::uint32_t& node : constraint.nodes) {
    node = nodes[node];
  }
  return constraint;
}

// Whether the nodes of one are among those of the other.
bool Nest(const JointConstraint& a, const JointConstraint& b) {
  const JointConstraint& small = a.nodes.size() < b.nodes.size() ? a : b;
  const JointConstraint& large = a.nodes.size() < b.nodes.size() ? b : a;
  return std::all_of(small.nodes.begin(), small.nodes.end(), [&](std::uint32_t node) {
    return std::find(large.nodes.begin(), large.nodes.end(), node) != large.nodes.end();
  });
}

}  // namespace

void IncrementalOptimizer::MakeJointTerm(std::uint32_t index) {
  if (joint_terms_[index] != kNone) {
    tree_.RemoveTerm(std::exchange(joint_terms_[index], kNone));
  }
  std::vector<std::uint32_t> variables;
  for (const std::uint32_t node : graph_.joint_constraints[index].nodes) {
    if (!nodes_[node].held) {
      variables.push_back(nodes_[node].variable);
    }
  }
  if (!variables.empty()) {
    joint_terms_[index] = tree_.AddTerm(variables);
    SetJointTerm(index);
  }
}

void IncrementalOptimizer::SetJointTerm(std::uint32_t index) {
  if (joint_terms_[index] == kNone) {
    return;
  }
  const JointConstraint& joint = graph_.joint_constraints[index];
  std::vector<bool> is_free;
  for (const std::uint32_t node : joint.nodes) {
    is_free.push_back(!nodes_[node].held);
  }
  WriteTerm(
      Linearised(graph_, joint), joint.information, is_free, tree_.SetTerm(joint_terms_[index]));
}

void IncrementalOptimizer::AddJoint(JointConstraint joint) {
  std::uint32_t index = 0;
  if (free_joints_.empty()) {
    index = static_cast<std::uint32_t>(graph_.joint_constraints.size());
    graph_.joint_constraints.emplace_back();
    joint_terms_.push_back(kNone);
  } else {
    index = free_joints_.back();
    free_joints_.pop_back();
  }
  for (std::size_t i = 0; i < joint.nodes.size(); ++i) {
    nodes_[joint.nodes[i]].joints.push_back(index);
    if (i > 0) {
      StiffenBy(joint, i, joint.nodes[i]);
      StiffenBy(joint, i, joint.nodes[0]);
    }
  }
  graph_.joint_constraints[index] = std::move(joint);
  MakeJointTerm(index);
}

void IncrementalOptimizer::RemoveJoint(std::uint32_t index) {
  const JointConstraint joint = std::exchange(graph_.joint_constraints[index], {});
  for (const std::uint32_t node : joint.nodes) {
    std::erase(nodes_[node].joints, index);
    StiffenAnew(node);
  }
  if (joint_terms_[index] != kNone) {
    tree_.RemoveTerm(std::exchange(joint_terms_[index], kNone));
  }
  free_joints_.push_back(index);
}

// A joint constraint that knows all nodes of this one, or some of them and no others, and is not
// among those to be left apart.
std::uint32_t IncrementalOptimizer::FindNested(const JointConstraint& joint,
                                               const std::vector<std::uint32_t>& apart) const {
  for (const std::uint32_t node : joint.nodes) {
    for (const std::uint32_t index : nodes_[node].joints) {
      if (Nest(graph_.joint_constraints[index], joint) &&
          std::find(apart.begin(), apart.end(), index) == apart.end()) {
        return index;
      }
    }
  }
  return kNone;
}

// Makes one of this and of all that nest with it: else nodes that stay would gather more and more
// of them from those that come and go around them.
void IncrementalOptimizer::AddToJoints(JointConstraint joint) {
  std::vector<std::uint32_t> apart;
  for (std::uint32_t index = FindNested(joint, apart); index != kNone;
       index = FindNested(joint, apart)) {
    const JointConstraint& other = graph_.joint_constraints[index];
    std::vector<std::uint32_t> nodes =
        other.nodes.size() > joint.nodes.size() ? other.nodes : joint.nodes;
    std::sort(nodes.begin(), nodes.end());
    const StatusOr<JointConstraint> sum =
        SumOf(PresentPoses(nodes), {CutOut(joint, nodes), CutOut(other, nodes)});
    if (!sum.ok()) {  // they disagree by half a turn: better apart
      apart.push_back(index);
      continue;
    }
    RemoveJoint(index);
    joint = PutBack(*sum, nodes);
  }
  AddJoint(std::move(joint));
}

PoseGraph IncrementalOptimizer::PresentPoses(const std::vector<std::uint32_t>& nodes) const {
  PoseGraph graph;
  for (const std::uint32_t node : nodes) {
    graph.map_from_node.push_back(map_from_node(node));
  }
  return graph;
}

Status IncrementalOptimizer::CheckMarginalisable(std::uint32_t index) const {
  if (index >= nodes_.size() || nodes_[index].marginalised) {
    return NotFoundError(NameOf(index) + ": is not there");
  }
  const Node& node = nodes_[index];
  if (graph_.fixed[index]) {
    return FailedPreconditionError(NameOf(index) + ": is fixed, cannot be marginalised");
  }
  if (!node.point_constraints.empty()) {
    return FailedPreconditionError(NameOf(index) + ": has point constraint " +
                                   std::to_string(node.point_constraints.front()) +
                                   ", cannot be marginalised");
  }
  for (const std::uint32_t constraint : node.constraints) {
    const std::size_t younger = graph_.constraints.size() - 1 - constraint;
    if (younger < options_.retract_window) {
      return FailedPreconditionError(NameOf(index) + ": constraint " + std::to_string(constraint) +
                                     " may still be taken back, since only " +
                                     std::to_string(younger) + " have come after it, must be " +
                                     std::to_string(options_.retract_window));
    }
  }
  return {};
}

// Ascending.
std::vector<std::uint32_t> IncrementalOptimizer::NeighboursOf(std::uint32_t node) const {
  std::vector<std::uint32_t> neighbours;
  for (const std::uint32_t index : nodes_[node].constraints) {
    neighbours.push_back(graph_.constraints[index].from);
    neighbours.push_back(graph_.constraints[index].to);
  }
  for (const std::uint32_t index : nodes_[node].joints) {
    const std::vector<std::uint32_t>& joined = graph_.joint_constraints[index].nodes;
    neighbours.insert(neighbours.end(), joined.begin(), joined.end());
  }
  std::sort(neighbours.begin(), neighbours.end());
  neighbours.erase(std::unique(neighbours.begin(), neighbours.end()), neighbours.end());
  std::erase(neighbours, node);
  return neighbours;
}

// In the numbers of the whole graph.
StatusOr<NodeMarginal> IncrementalOptimizer::MarginalOfNode(
    std::uint32_t node, const std::vector<std::uint32_t>& neighbours) const {
  std::vector<std::uint32_t> nodes = neighbours;
  nodes.insert(std::lower_bound(nodes.begin(), nodes.end(), node), node);
  PoseGraph star = PresentPoses(nodes);
  for (const std::uint32_t index : nodes_[node].constraints) {
    star.constraints.push_back(CutOut(graph_.constraints[index], nodes));
  }
  for (const std::uint32_t index : nodes_[node].joints) {
    star.joint_constraints.push_back(CutOut(graph_.joint_constraints[index], nodes));
  }
  StatusOr<NodeMarginal> marginal = UnnamedMarginalOf(
      star, PlaceOf(node, nodes), {options_.dense_neighbours_max, options_.kernel});
  if (!marginal.ok()) {
    return Status(marginal.status().code(), NameOf(node) + ": " + marginal.status().message());
  }
  for (GraphConstraint& constraint : marginal->constraints) {
    constraint.from = nodes[constraint.from];
    constraint.to = nodes[constraint.to];
  }
  for (JointConstraint& joint : marginal->joint_constraints) {
    joint = PutBack(std::move(joint), nodes);
  }
  return marginal;
}

Status IncrementalOptimizer::MarginaliseNode(std::uint32_t index) {
  LOCI_RETURN_IF_ERROR(CheckMarginalisable(index));
  const std::vector<std::uint32_t> neighbours = NeighboursOf(index);
  LOCI_ASSIGN_OR_RETURN(const NodeMarginal marginal, MarginalOfNode(index, neighbours));
  Node& node = nodes_[index];
  graph_.map_from_node[index] = map_from_node(index);
  while (!node.constraints.empty()) {
    Detach(node.constraints.back(), ConstraintState::kMarginalised);
  }
  while (!node.joints.empty()) {
    RemoveJoint(node.joints.back());
  }
  const bool was_held = std::exchange(node.held, true);
  if (!was_held) {
    RemoveVariable(std::exchange(node.variable, kNone));
  }
  node.marginalised = true;
  for (const GraphConstraint& constraint : marginal.constraints) {
    AddToJoints(JointOf(constraint));
  }
  for (const JointConstraint& joint : marginal.joint_constraints) {
    AddToJoints(joint);
  }
  if (was_held && !neighbours.empty()) {  // another one has to be
    Regroup(ConnectedTo(neighbours.front()));
  }
  return {};
}

}  // namespace loci
