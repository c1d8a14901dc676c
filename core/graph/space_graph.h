// SPDX-License-Identifier: Apache-2.0
// Pose graphs in space, SE(3): for offline optimisation; the engine's graphs lie in the plane.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/base/status.h"
#include "core/geometry/se3.h"
#include "core/graph/pose_graph.h"
#include "core/graph/toro_tree.h"

namespace loci {

// A measured pose of node `to` in the frame of node `from`.
//
// Error: (translation, vector part of the unit quaternion with w >= 0) of
// Inverse(from_from_to) * Inverse(map_from_from) * map_from_to, as g2o's EDGE_SE3:QUAT has it.
struct SpaceConstraint {
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  Pose3 from_from_to = {};
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();
};

// A measured position of a point in the frame of a node.
//
// Error: Inverse(map_from_from) * point_in_map - point_in_from. g2o's EDGE_SE3_TRACKXYZ measures in
// a frame on the node; measurement and information can be turned into the node's without loss.
struct SpacePointConstraint {
  std::uint32_t from = 0;
  std::uint32_t point = 0;
  Eigen::Vector3d point_in_from = Eigen::Vector3d::Zero();
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
};

// A measured pose, in the map, of a frame on a node.
//
// Error: (translation, vector part of the quaternion) of Inverse(map_from_sensor) * map_from_node *
// node_from_sensor (g2o's EDGE_SE3_PRIOR; its parameter is node_from_sensor).
struct SpacePosePrior {
  std::uint32_t node = 0;
  Pose3 map_from_sensor = {};  // as measured
  Pose3 node_from_sensor = {};
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();
};

// A measured position of a node in the map: GNSS (g2o's EDGE_SE3_XYZ_PRIOR).
//
// Error: the node's position - node_in_map.
struct SpacePositionPrior {
  std::uint32_t node = 0;
  Eigen::Vector3d node_in_map = Eigen::Vector3d::Zero();
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
};

// As PoseGraph, in space.
struct SpaceGraph {
  std::vector<Pose3> map_from_node;
  std::vector<SpaceConstraint> constraints;
  std::vector<bool> fixed;
  std::vector<Eigen::Vector3d> points_in_map;
  std::vector<SpacePointConstraint> point_constraints;
  std::vector<bool> fixed_points;
  std::vector<SpacePosePrior> pose_priors;
  std::vector<SpacePositionPrior> position_priors;

  bool IsFixed(std::size_t node) const { return node < fixed.size() && fixed[node]; }
  bool IsPointFixed(std::size_t point) const {
    return point < fixed_points.size() && fixed_points[point];
  }
};

Eigen::Matrix<double, 6, 1> ErrorOf(const SpaceGraph& graph, const SpaceConstraint& constraint);
Eigen::Vector3d ErrorOf(const SpaceGraph& graph, const SpacePointConstraint& constraint);
Eigen::Matrix<double, 6, 1> ErrorOf(const SpaceGraph& graph, const SpacePosePrior& prior);
Eigen::Vector3d ErrorOf(const SpaceGraph& graph, const SpacePositionPrior& prior);
// The sum of e^T Omega e, in the order of the constraints, then of the priors.
double Chi2(const SpaceGraph& graph);
// As ValidateGraph for the plane.
Status ValidateGraph(const SpaceGraph& graph);
std::size_t CountZeroInformation(const SpaceGraph& graph);

// The same nodes, points and constraints without their numbers: components and trees depend on
// these alone.
PoseGraph TopologyOf(const SpaceGraph& graph);
GraphComponents FindComponents(const SpaceGraph& graph);
ToroTree BreadthFirstTree(const SpaceGraph& graph);
// As for the plane.
void PlaceByTree(const ToroTree& tree, SpaceGraph& graph);
void PlacePoints(SpaceGraph& graph);

}  // namespace loci
