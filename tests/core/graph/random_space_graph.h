// SPDX-License-Identifier: Apache-2.0
// Random pose graphs in space for tests.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/base/math.h"
#include "core/base/random.h"
#include "core/geometry/se3.h"
#include "core/graph/space_graph.h"

namespace loci {

// Coordinates up to `range_m`; a turn by about twice `quaternion_range` at most, if that is small.
inline Pose3 RandomPose3(RandomSequence& random, double range_m, double quaternion_range) {
  Pose3 pose;
  const auto number = [&](double range) { return random.NextUniform(-range, range); };
  pose.translation = {number(range_m), number(range_m), number(range_m)};
  pose.rotation =
      Eigen::Quaterniond(
          1.0, number(quaternion_range), number(quaternion_range), number(quaternion_range))
          .normalized();
  return pose;
}

// A small motion in the node's own frame: (translation, rotation vector).
inline Pose3 Perturbed(const Pose3& pose, int axis, double by) {
  Pose3 motion;
  if (axis < 3) {
    motion.translation(axis) = by;
  } else {
    motion.rotation = Eigen::AngleAxisd(by, Eigen::Vector3d::Unit(axis - 3));
  }
  return pose * motion;
}

// Nodes anywhere in a box of 10 m, tied to the next and to the seventh after; the poses given are a
// little off.
inline SpaceGraph RandomSpaceGraph(std::uint64_t seed, std::uint32_t count) {
  RandomSequence random(seed);
  SpaceGraph truth;
  for (std::uint32_t i = 0; i < count; ++i) {
    truth.map_from_node.push_back(RandomPose3(random, 5.0, 2.0));
  }
  SpaceGraph graph = truth;
  for (std::uint32_t i = 0; i < count; ++i) {
    for (const std::uint32_t j : {i + 1, i + 7}) {
      if (j < count) {
        SpaceConstraint constraint;
        constraint.from = i;
        constraint.to = j;
        constraint.from_from_to = Inverse(truth.map_from_node[i]) * truth.map_from_node[j] *
                                  RandomPose3(random, 0.05, 0.02);
        constraint.information *= 400.0;
        graph.constraints.push_back(constraint);
      }
    }
    graph.map_from_node[i] = graph.map_from_node[i] * RandomPose3(random, 0.5, 0.2);
  }
  return graph;
}

// Rounds on a ring that is tilted and climbs, each node tied to that of the round before. The poses
// given are those of noisy odometry.
inline SpaceGraph RandomSpaceLoops(std::uint64_t seed, std::uint32_t node_count) {
  constexpr std::uint32_t kRound = 25;
  RandomSequence random(seed);
  Pose3 step;
  step.translation = {1.0, 0.0, 0.05};
  step.rotation = Eigen::Quaterniond(
      Eigen::AngleAxisd(2.0 * kPi / kRound, Eigen::Vector3d(0.05, 0.1, 1.0).normalized()));
  std::vector<Pose3> truth(1);
  SpaceGraph graph;
  graph.map_from_node.resize(1);
  graph.fixed = {true};
  const auto add = [&](std::uint32_t from, std::uint32_t to) {
    SpaceConstraint constraint;
    constraint.from = from;
    constraint.to = to;
    constraint.from_from_to = Inverse(truth[from]) * truth[to] * RandomPose3(random, 0.03, 0.02);
    constraint.information *= 1000.0;
    graph.constraints.push_back(constraint);
  };
  for (std::uint32_t i = 1; i < node_count; ++i) {
    truth.push_back(truth.back() * step);
    add(i - 1, i);
    graph.map_from_node.push_back(graph.map_from_node.back() *
                                  graph.constraints.back().from_from_to);
    if (i >= kRound) {
      add(i - kRound, i);
    }
  }
  return graph;
}

template <int kSize>
Eigen::Matrix<double, kSize, kSize> RandomSpaceInformation(RandomSequence& random) {
  Eigen::Matrix<double, kSize, kSize> root;
  for (int i = 0; i < kSize * kSize; ++i) {
    root(i) = random.NextUniform(-3.0, 3.0);
  }
  const Eigen::Matrix<double, kSize, kSize> information = root.transpose() * root;
  return 0.5 * (information + information.transpose()) +
         Eigen::Matrix<double, kSize, kSize>::Identity();
}

// Points, each seen by four nodes in a row; noise 0.05 m.
inline void AddPoints(std::uint64_t seed, std::uint32_t count, SpaceGraph& graph) {
  RandomSequence random(seed);
  for (std::uint32_t k = 0; k < count; ++k) {
    const Eigen::Vector3d point = RandomPose3(random, 5.0, 0.0).translation;
    graph.points_in_map.push_back(point);
    const std::uint64_t first = random.NextBits() % (graph.map_from_node.size() - 3);
    for (std::uint64_t i = first; i < first + 4; ++i) {
      SpacePointConstraint constraint;
      constraint.from = static_cast<std::uint32_t>(i);
      constraint.point = k;
      const Pose3 node_from_map = Inverse(graph.map_from_node[i]);
      constraint.point_in_from = node_from_map.translation + node_from_map.rotation * point +
                                 RandomPose3(random, 0.05, 0.0).translation;
      constraint.information = RandomSpaceInformation<3>(random);
      graph.point_constraints.push_back(constraint);
    }
  }
}

// Every third node gets a position, every fifth a pose in the map, of a sensor that sits askew.
inline void AddPriors(std::uint64_t seed, SpaceGraph& graph) {
  RandomSequence random(seed);
  for (std::uint32_t i = 0; i < graph.map_from_node.size(); ++i) {
    if (i % 3 == 0) {
      graph.position_priors.push_back(
          {i,
           graph.map_from_node[i].translation + RandomPose3(random, 0.5, 0.0).translation,
           RandomSpaceInformation<3>(random)});
    }
    if (i % 5 == 0) {
      const Pose3 node_from_sensor = RandomPose3(random, 1.0, 1.0);
      graph.pose_priors.push_back(
          {i,
           graph.map_from_node[i] * node_from_sensor * RandomPose3(random, 0.2, 0.1),
           node_from_sensor,
           RandomSpaceInformation<6>(random)});
    }
  }
}

}  // namespace loci
