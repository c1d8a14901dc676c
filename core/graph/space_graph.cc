// SPDX-License-Identifier: Apache-2.0
// Error, chi2, validity and trees of pose graphs in space.
#include "core/graph/space_graph.h"

#include <algorithm>
#include <string>

#include "core/graph/information.h"

namespace loci {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

Vector6 ErrorVector(const Pose3& error) {
  Vector6 vector;
  vector << error.translation, (error.rotation.w() < 0.0 ? -1.0 : 1.0) * error.rotation.vec();
  return vector;
}

template <typename Term>
double SumOfChi2(const SpaceGraph& graph, const std::vector<Term>& terms, double sum) {
  for (const Term& term : terms) {
    const auto error = ErrorOf(graph, term);
    sum += error.dot(term.information * error);
  }
  return sum;
}

template <typename Term>
std::size_t CountZero(const std::vector<Term>& terms) {
  return static_cast<std::size_t>(std::count_if(terms.begin(), terms.end(), [](const Term& term) {
    return (term.information.array() == 0.0).all();
  }));
}

bool IsFinite(const Pose3& pose) {
  return pose.translation.allFinite() && pose.rotation.coeffs().allFinite();
}

Status RequireFinite(bool finite, const std::string& field) {
  return finite ? Status() : InvalidArgumentError(field + ": a number is not finite");
}

Status RequireIndex(std::uint32_t index, std::size_t count, const std::string& field) {
  if (index < count) {
    return {};
  }
  return InvalidArgumentError(field + ": " + std::to_string(index) + ", must be < " +
                              std::to_string(count));
}

Status ValidateTerm(const SpaceGraph& graph,
                    const SpaceConstraint& constraint,
                    const std::string& name) {
  const std::size_t count = graph.map_from_node.size();
  if (constraint.from >= count || constraint.to >= count || constraint.from == constraint.to) {
    return InvalidArgumentError(name + ": joins nodes " + std::to_string(constraint.from) +
                                " and " + std::to_string(constraint.to) +
                                ", must be two different ones < " + std::to_string(count));
  }
  return RequireFinite(IsFinite(constraint.from_from_to), name + ".from_from_to");
}

Status ValidateTerm(const SpaceGraph& graph,
                    const SpacePointConstraint& constraint,
                    const std::string& name) {
  LOCI_RETURN_IF_ERROR(RequireIndex(constraint.from, graph.map_from_node.size(), name + ".from"));
  LOCI_RETURN_IF_ERROR(RequireIndex(constraint.point, graph.points_in_map.size(), name + ".point"));
  return RequireFinite(constraint.point_in_from.allFinite(), name + ".point_in_from");
}

Status ValidateTerm(const SpaceGraph& graph, const SpacePosePrior& prior, const std::string& name) {
  LOCI_RETURN_IF_ERROR(RequireIndex(prior.node, graph.map_from_node.size(), name + ".node"));
  LOCI_RETURN_IF_ERROR(RequireFinite(IsFinite(prior.map_from_sensor), name + ".map_from_sensor"));
  return RequireFinite(IsFinite(prior.node_from_sensor), name + ".node_from_sensor");
}

Status ValidateTerm(const SpaceGraph& graph,
                    const SpacePositionPrior& prior,
                    const std::string& name) {
  LOCI_RETURN_IF_ERROR(RequireIndex(prior.node, graph.map_from_node.size(), name + ".node"));
  return RequireFinite(prior.node_in_map.allFinite(), name + ".node_in_map");
}

template <typename Term>
Status ValidateTerms(const SpaceGraph& graph,
                     const std::vector<Term>& terms,
                     const std::string& name) {
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const std::string term_name = name + "[" + std::to_string(i) + "]";
    LOCI_RETURN_IF_ERROR(ValidateTerm(graph, terms[i], term_name));
    LOCI_RETURN_IF_ERROR(ValidateInformation(terms[i].information, term_name + ".information"));
  }
  return {};
}

}  // namespace

Vector6 ErrorOf(const SpaceGraph& graph, const SpaceConstraint& constraint) {
  return ErrorVector(
      Inverse(constraint.from_from_to) *
      (Inverse(graph.map_from_node[constraint.from]) * graph.map_from_node[constraint.to]));
}

Eigen::Vector3d ErrorOf(const SpaceGraph& graph, const SpacePointConstraint& constraint) {
  const Pose3& map_from_node = graph.map_from_node[constraint.from];
  return map_from_node.rotation.conjugate() *
             (graph.points_in_map[constraint.point] - map_from_node.translation) -
         constraint.point_in_from;
}

Vector6 ErrorOf(const SpaceGraph& graph, const SpacePosePrior& prior) {
  return ErrorVector(Inverse(prior.map_from_sensor) *
                     (graph.map_from_node[prior.node] * prior.node_from_sensor));
}

Eigen::Vector3d ErrorOf(const SpaceGraph& graph, const SpacePositionPrior& prior) {
  return graph.map_from_node[prior.node].translation - prior.node_in_map;
}

double Chi2(const SpaceGraph& graph) {
  double sum = SumOfChi2(graph, graph.constraints, 0.0);
  sum = SumOfChi2(graph, graph.point_constraints, sum);
  sum = SumOfChi2(graph, graph.pose_priors, sum);
  return SumOfChi2(graph, graph.position_priors, sum);
}

Status ValidateGraph(const SpaceGraph& graph) {
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    LOCI_RETURN_IF_ERROR(RequireFinite(IsFinite(graph.map_from_node[i]),
                                       "map_from_node[" + std::to_string(i) + "]"));
  }
  for (std::size_t i = 0; i < graph.points_in_map.size(); ++i) {
    LOCI_RETURN_IF_ERROR(RequireFinite(graph.points_in_map[i].allFinite(),
                                       "points_in_map[" + std::to_string(i) + "]"));
  }
  LOCI_RETURN_IF_ERROR(ValidateTerms(graph, graph.constraints, "constraints"));
  LOCI_RETURN_IF_ERROR(ValidateTerms(graph, graph.point_constraints, "point_constraints"));
  LOCI_RETURN_IF_ERROR(ValidateTerms(graph, graph.pose_priors, "pose_priors"));
  return ValidateTerms(graph, graph.position_priors, "position_priors");
}

std::size_t CountZeroInformation(const SpaceGraph& graph) {
  return CountZero(graph.constraints) + CountZero(graph.point_constraints) +
         CountZero(graph.pose_priors) + CountZero(graph.position_priors);
}

PoseGraph TopologyOf(const SpaceGraph& graph) {
  PoseGraph topology;
  topology.map_from_node.resize(graph.map_from_node.size());
  topology.fixed = graph.fixed;
  topology.constraints.resize(graph.constraints.size());
  for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
    topology.constraints[i].from = graph.constraints[i].from;
    topology.constraints[i].to = graph.constraints[i].to;
  }
  topology.points_in_map.resize(graph.points_in_map.size(), Eigen::Vector2d::Zero());
  topology.point_constraints.resize(graph.point_constraints.size());
  for (std::size_t i = 0; i < graph.point_constraints.size(); ++i) {
    topology.point_constraints[i].from = graph.point_constraints[i].from;
    topology.point_constraints[i].point = graph.point_constraints[i].point;
  }
  return topology;
}

GraphComponents FindComponents(const SpaceGraph& graph) {
  return FindComponents(TopologyOf(graph));
}

ToroTree BreadthFirstTree(const SpaceGraph& graph) {
  return BreadthFirstTree(TopologyOf(graph));
}

void PlaceByTree(const ToroTree& tree, SpaceGraph& graph) {
  for (const std::uint32_t node : tree.order) {
    if (tree.parent[node] == ToroTree::kNone) {
      continue;
    }
    const SpaceConstraint& constraint = graph.constraints[tree.parent_constraint[node]];
    graph.map_from_node[node] =
        graph.map_from_node[tree.parent[node]] *
        (constraint.to == node ? constraint.from_from_to : Inverse(constraint.from_from_to));
  }
  PlacePoints(graph);
}

void PlacePoints(SpaceGraph& graph) {
  std::vector<bool> placed = graph.fixed_points;
  placed.resize(graph.points_in_map.size());
  for (const SpacePointConstraint& constraint : graph.point_constraints) {
    if (!placed[constraint.point]) {
      placed[constraint.point] = true;
      const Pose3& map_from_node = graph.map_from_node[constraint.from];
      graph.points_in_map[constraint.point] =
          map_from_node.translation + map_from_node.rotation * constraint.point_in_from;
    }
  }
}

}  // namespace loci
