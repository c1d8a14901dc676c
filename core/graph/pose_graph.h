// SPDX-License-Identifier: Apache-2.0
// The pose graph: nodes and points in the plane, what has been measured of them, and chi2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/base/status.h"
#include "core/geometry/se2.h"

namespace loci {

// A measured pose of node `to` in the frame of node `from`.
//
// Error: e = vector(Inverse(from_from_to) * (Inverse(map_from_from) * map_from_to)) in the order
// (x, y, theta), theta wrapped: the error of g2o's EDGE_SE2, so that chi2 compares with others'.
struct GraphConstraint {
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  Pose2 from_from_to = {};
  Eigen::Matrix3d information =
      Eigen::Matrix3d::Identity();  // (x, y, theta), positive semidefinite
  bool robust = false;  // may be wrong (a closure): the optimiser's robust kernel applies to it
};

// Measured poses of nodes in the frame of another one, with one information of them all: what a
// node that has been removed said of its neighbours (marginalise.h).
//
// Error: those of GraphConstraints from nodes[0] to nodes[1], nodes[2] .., stacked. Never robust.
struct JointConstraint {
  std::vector<std::uint32_t> nodes;    // two or more, no two of them equal
  std::vector<Pose2> first_from_node;  // of nodes[1], nodes[2] .. in the frame of nodes[0]
  Eigen::MatrixXd information;         // of the stacked error, positive semidefinite
};

// A measured position of a point in the frame of a node.
//
// Error: e = Inverse(map_from_from) * point_in_map - point_in_from (g2o's EDGE_SE2_XY).
struct PointConstraint {
  std::uint32_t from = 0;   // index of a node
  std::uint32_t point = 0;  // index of a point
  Eigen::Vector2d point_in_from = Eigen::Vector2d::Zero();
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity();
  bool robust = false;
};

// A measured pose of a node in the map: a place that is known, an absolute scan match.
//
// Error: vector(Inverse(measured) * map_from_node) in the order (x, y, theta), as g2o's
// EDGE_PRIOR_SE2 has it.
struct PosePrior {
  std::uint32_t node = 0;
  Pose2 map_from_node = {};  // as measured
  Eigen::Matrix3d information =
      Eigen::Matrix3d::Identity();  // (x, y, theta) in the measured frame, positive semidefinite
  bool robust = false;
};

// A measured position of a node in the map, without a heading: GNSS.
//
// Error: the node's position - node_in_map (g2o's EDGE_PRIOR_SE2_XY).
struct PositionPrior {
  std::uint32_t node = 0;
  Eigen::Vector2d node_in_map = Eigen::Vector2d::Zero();
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity();  // (x, y) in the map
  bool robust = false;
};

// Nodes, points, constraints and priors. Any number of components.
//
// `fixed` says which nodes keep their pose, `fixed_points` which points; each may be shorter than
// what it speaks of, the rest is free. What holds a component that nothing ties to the map, or not
// in all directions, is said in gauge.h.
struct PoseGraph {
  std::vector<Pose2> map_from_node;
  std::vector<GraphConstraint> constraints;
  std::vector<bool> fixed;
  std::vector<Eigen::Vector2d> points_in_map;
  std::vector<PointConstraint> point_constraints;
  std::vector<bool> fixed_points;
  std::vector<PosePrior> pose_priors;
  std::vector<PositionPrior> position_priors;
  std::vector<JointConstraint> joint_constraints;

  bool IsFixed(std::size_t node) const { return node < fixed.size() && fixed[node]; }
  bool IsPointFixed(std::size_t point) const {
    return point < fixed_points.size() && fixed_points[point];
  }
};

// The error vector of one constraint or prior.
Eigen::Vector3d ErrorOf(const PoseGraph& graph, const GraphConstraint& constraint);
Eigen::Vector2d ErrorOf(const PoseGraph& graph, const PointConstraint& constraint);
Eigen::Vector3d ErrorOf(const PoseGraph& graph, const PosePrior& prior);
Eigen::Vector2d ErrorOf(const PoseGraph& graph, const PositionPrior& prior);
Eigen::VectorXd ErrorOf(const PoseGraph& graph, const JointConstraint& constraint);

// e^T Omega e of one constraint or prior.
double Chi2Of(const PoseGraph& graph, const GraphConstraint& constraint);
double Chi2Of(const PoseGraph& graph, const PointConstraint& constraint);
double Chi2Of(const PoseGraph& graph, const PosePrior& prior);
double Chi2Of(const PoseGraph& graph, const PositionPrior& prior);
double Chi2Of(const PoseGraph& graph, const JointConstraint& constraint);
// The same with the ends somewhere else.
double Chi2Of(const GraphConstraint& constraint,
              const Pose2& map_from_from,
              const Pose2& map_from_to);
double Chi2Of(const PointConstraint& constraint,
              const Pose2& map_from_from,
              const Eigen::Vector2d& point_in_map);

// The sum over all constraints and priors, in the order of their index; no kernel, no factor 1/2.
double Chi2(const PoseGraph& graph);

// kInvalidArgument, naming the constraint or prior and the field, if an index is out of range, a
// constraint joins a node to itself, a number is not finite, an information is not symmetric
// positive semidefinite (core/graph/information.h), or the parts of a joint constraint do not match
// in number.
Status ValidateGraph(const PoseGraph& graph);

// Constraints and priors whose information is zero: they count, and say nothing.
std::size_t CountZeroInformation(const PoseGraph& graph);

// Puts constraints into the order (from, to, measurement, information, robust), and priors
// alike, so that the result of an optimisation does not depend on the order in which they arrived.
void SortConstraints(PoseGraph& graph);

// Component of each node and, after them, of each point: numbered from 0 by their lowest node.
// Points without a constraint are components of their own.
struct GraphComponents {
  std::vector<std::uint32_t> of_node;
  std::vector<std::uint32_t> of_point;
  std::uint32_t count = 0;
};
GraphComponents FindComponents(const PoseGraph& graph);

// The nodes that an optimiser holds: those that are fixed, and the lowest of each component that
// neither a fixed node nor anything else ties to the map (gauge.h). As long as the nodes.
std::vector<bool> HeldNodes(const PoseGraph& graph);

}  // namespace loci
