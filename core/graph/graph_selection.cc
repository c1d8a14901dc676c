// SPDX-License-Identifier: Apache-2.0
// Filters over the four kinds of terms.
#include "core/graph/graph_selection.h"

#include <cstddef>
#include <utility>

namespace loci {
namespace {

template <typename Term>
std::vector<bool> NotRobust(const std::vector<Term>& terms) {
  std::vector<bool> result;
  for (const Term& term : terms) {
    result.push_back(!term.robust);
  }
  return result;
}

template <typename Term>
std::vector<Term> Selected(const std::vector<Term>& terms, const std::vector<bool>& selection) {
  std::vector<Term> result;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (selection[i]) {
      result.push_back(terms[i]);
    }
  }
  return result;
}

}  // namespace

GraphSelection AllOf(const PoseGraph& graph) {
  return {std::vector<bool>(graph.constraints.size(), true),
          std::vector<bool>(graph.point_constraints.size(), true),
          std::vector<bool>(graph.pose_priors.size(), true),
          std::vector<bool>(graph.position_priors.size(), true)};
}

GraphSelection TrustedOf(const PoseGraph& graph) {
  return {NotRobust(graph.constraints),
          NotRobust(graph.point_constraints),
          NotRobust(graph.pose_priors),
          NotRobust(graph.position_priors)};
}

PoseGraph PartOf(const PoseGraph& graph, const GraphSelection& selection) {
  PoseGraph part;
  part.map_from_node = graph.map_from_node;
  part.fixed = graph.fixed;
  part.points_in_map = graph.points_in_map;
  part.fixed_points = graph.fixed_points;
  part.constraints = Selected(graph.constraints, selection.constraints);
  part.point_constraints = Selected(graph.point_constraints, selection.point_constraints);
  part.pose_priors = Selected(graph.pose_priors, selection.pose_priors);
  part.position_priors = Selected(graph.position_priors, selection.position_priors);
  part.joint_constraints = graph.joint_constraints;
  return part;
}

void TakePoses(PoseGraph&& part, PoseGraph& graph) {
  graph.map_from_node = std::move(part.map_from_node);
  graph.points_in_map = std::move(part.points_in_map);
}

OptimizationSummary OptimizePart(const GraphSelection& selection,
                                 const SparseOptions& options,
                                 PoseGraph& graph) {
  PoseGraph part = PartOf(graph, selection);
  const OptimizationSummary summary = OptimizeSparse(part, options);
  TakePoses(std::move(part), graph);
  return summary;
}

}  // namespace loci
