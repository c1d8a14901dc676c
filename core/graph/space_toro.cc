// SPDX-License-Identifier: Apache-2.0
// Spreading rotations and offsets over paths in space.
#include "core/graph/space_toro.h"

#include <algorithm>
#include <utility>

#include "core/base/math.h"

namespace loci {
namespace {

// Of a quaternion's vector part: below it there is no axis, and nothing to turn.
constexpr double kTurnMin = 1e-15;

Eigen::Quaterniond RotationAbout(const Eigen::Vector3d& unit_axis, double angle_rad) {
  const Eigen::Vector3d vector = Sin(0.5 * angle_rad) * unit_axis;
  return {Cos(0.5 * angle_rad), vector.x(), vector.y(), vector.z()};
}

}  // namespace

SpaceToroOptimizer::SpaceToroOptimizer(const SpaceGraph& graph) {
  const ToroTree tree = BreadthFirstTree(graph);
  AddNodes(graph, tree);
  AddConstraints(graph, tree);
  turn_.assign(parent_.size(), Eigen::Quaterniond::Identity());
}

void SpaceToroOptimizer::AddNodes(const SpaceGraph& graph, const ToroTree& tree) {
  const std::size_t count = graph.map_from_node.size();
  std::vector<std::uint32_t> index_of_node(count);
  node_of_index_ = tree.order;
  for (std::uint32_t index = 0; index < count; ++index) {
    const std::uint32_t node = tree.order[index];
    index_of_node[node] = index;
    const Pose3& pose = graph.map_from_node[node];
    const Eigen::Quaterniond rotation = pose.rotation.normalized();
    map_from_node_.push_back(rotation);
    if (tree.parent[node] == ToroTree::kNone) {
      parent_.push_back(ToroTree::kNone);
      parent_from_node_.push_back(rotation);
      offset_.push_back(pose.translation);
      continue;
    }
    const std::uint32_t parent = index_of_node[tree.parent[node]];
    parent_.push_back(parent);
    parent_from_node_.push_back(map_from_node_[parent].conjugate() * rotation);
    offset_.push_back(pose.translation - graph.map_from_node[tree.parent[node]].translation);
  }
}

void SpaceToroOptimizer::AddConstraints(const SpaceGraph& graph, const ToroTree& tree) {
  std::vector<std::uint32_t> index_of_node(parent_.size());
  for (std::uint32_t index = 0; index < parent_.size(); ++index) {
    index_of_node[node_of_index_[index]] = index;
  }
  const auto find_path = [&](std::uint32_t constraint, ToroPath& path) {
    const SpaceConstraint& measured = graph.constraints[constraint];
    FindToroPath(
        {index_of_node[measured.from], index_of_node[measured.to]},
        [this](std::uint32_t index) { return parent_[index]; },
        [&](std::uint32_t index) { return tree.depth[node_of_index_[index]]; },
        path);
  };
  ToroPath path;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> order;  // top depth, constraint
  std::vector<ToroWeights> stiffness(parent_.size());
  for (std::uint32_t i = 0; i < graph.constraints.size(); ++i) {
    find_path(i, path);
    order.emplace_back(path.top_depth, i);
    for (const std::vector<std::uint32_t>* half : {&path.from_half, &path.to_half}) {
      for (const std::uint32_t index : *half) {
        stiffness[index] += ToroWeightsFrom<3>(graph.constraints[i].information);
      }
    }
  }
  for (std::uint32_t index = 0; index < parent_.size(); ++index) {
    paths_.AddNode();
    if (parent_[index] != ToroTree::kNone) {
      paths_.SetStiffness(index, stiffness[index]);
    }
  }
  std::sort(order.begin(), order.end());
  for (const auto& [top_depth, i] : order) {
    const SpaceConstraint& measured = graph.constraints[i];
    find_path(i, path);
    paths_.AddConstraint(path, ToroWeightsFrom<3>(measured.information));
    constraints_.push_back(
        {index_of_node[measured.from],
         {measured.from_from_to.translation, measured.from_from_to.rotation.normalized()}});
  }
  rates_.resize(constraints_.size());
}

void SpaceToroOptimizer::Sweep() {
  rates_.assign(constraints_.size(), rate_);
  for (std::size_t i = 0; i < constraints_.size(); ++i) {
    SpreadRotation(i);
  }
  TurnSubtrees();
  paths_.SpreadTranslations(
      rates_,
      [this](std::size_t i) -> Eigen::Vector3d {
        return map_from_node_[constraints_[i].from] * constraints_[i].from_from_to.translation;
      },
      offset_);
  rate_ /= 1.0 + rate_;
}

// The rotation of a half's end in the frame of the path's top.
Eigen::Quaterniond SpaceToroOptimizer::RotationAtTop(std::span<const std::uint32_t> half) const {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  for (const std::uint32_t index : half) {
    rotation = parent_from_node_[index] * rotation;
  }
  return rotation;
}

void SpaceToroOptimizer::SpreadRotation(std::size_t constraint) {
  const double share = paths_.RotationShare(constraint, rate_);
  if (share == 0.0) {
    return;
  }
  const Eigen::Quaterniond residual = RotationAtTop(paths_.FromHalf(constraint)) *
                                      constraints_[constraint].from_from_to.rotation *
                                      RotationAtTop(paths_.ToHalf(constraint)).conjugate();
  const double sine = residual.vec().norm();
  if (sine < kTurnMin) {
    return;
  }
  // Both signs of a quaternion are one rotation: the one with w >= 0 is the shorter way.
  const double sign = residual.w() < 0.0 ? -1.0 : 1.0;
  const double angle_rad = 2.0 * Atan2(sine, sign * residual.w());
  const Eigen::Vector3d axis_at_top = (sign / sine) * residual.vec();
  TurnHalf(paths_.FromHalf(constraint), axis_at_top, -share * angle_rad);
  TurnHalf(paths_.ToHalf(constraint), axis_at_top, share * angle_rad);
}

// From the top down, with the axis in the frame of each node's parent as it was before.
void SpaceToroOptimizer::TurnHalf(std::span<const std::uint32_t> half,
                                  const Eigen::Vector3d& axis_at_top,
                                  double rad_per_compliance) {
  Eigen::Vector3d axis_in_parent = axis_at_top;
  for (std::size_t k = half.size(); k-- > 0;) {
    Eigen::Quaterniond& parent_from_node = parent_from_node_[half[k]];
    const Eigen::Vector3d axis_in_node = parent_from_node.conjugate() * axis_in_parent;
    const double angle_rad = rad_per_compliance * paths_.rotation_compliance()[half[k]];
    if (angle_rad != 0.0) {
      parent_from_node = (RotationAbout(axis_in_parent, angle_rad) * parent_from_node).normalized();
    }
    axis_in_parent = axis_in_node;
  }
}

// Brings rotations in the map up to date, and turns each offset as far as the parent was turned.
void SpaceToroOptimizer::TurnSubtrees() {
  for (std::size_t i = 0; i < parent_.size(); ++i) {
    const std::uint32_t parent = parent_[i];
    if (parent == ToroTree::kNone) {
      continue;
    }
    offset_[i] = turn_[parent] * offset_[i];
    const Eigen::Quaterniond rotation =
        (map_from_node_[parent] * parent_from_node_[i]).normalized();
    turn_[i] = rotation * map_from_node_[i].conjugate();
    map_from_node_[i] = rotation;
  }
}

std::vector<Pose3> SpaceToroOptimizer::Poses() const {
  std::vector<Pose3> poses(parent_.size());
  for (std::size_t i = 0; i < parent_.size(); ++i) {
    Pose3& pose = poses[node_of_index_[i]];
    pose.rotation = map_from_node_[i];
    pose.translation = offset_[i];
    if (parent_[i] != ToroTree::kNone) {
      pose.translation += poses[node_of_index_[parent_[i]]].translation;
    }
  }
  return poses;
}

}  // namespace loci
