// SPDX-License-Identifier: Apache-2.0
// Random pose graphs for tests: a walk with noisy loop constraints.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/base/random.h"
#include "core/geometry/se2.h"
#include "core/graph/pose_graph.h"

namespace loci {

inline Pose2 RandomPose(RandomSequence& random, double range_m, double range_rad) {
  return {random.NextUniform(-range_m, range_m),
          random.NextUniform(-range_m, range_m),
          WrapAngle(random.NextUniform(-range_rad, range_rad))};
}

// Symmetric positive definite, eigenvalues between about 1 and 100.
inline Eigen::Matrix3d RandomInformation(RandomSequence& random) {
  Eigen::Matrix3d root;
  for (int i = 0; i < 9; ++i) {
    root(i) = random.NextUniform(-3.0, 3.0);
  }
  const Eigen::Matrix3d information = root.transpose() * root;
  return 0.5 * (information + information.transpose()) + Eigen::Matrix3d::Identity();
}

inline Pose2 Noise(RandomSequence& random, double sigma_m, double sigma_rad) {
  return {sigma_m * random.NextNormal(),
          sigma_m * random.NextNormal(),
          sigma_rad * random.NextNormal()};
}

// A robot that drives around a square of 20 m again and again, tied to what it saw one round
// before. The poses given are those of noisy odometry.
inline PoseGraph RandomLoopGraph(std::uint64_t seed, std::uint32_t node_count) {
  constexpr std::uint32_t kRound = 20;
  constexpr double kSigmaM = 0.05;
  constexpr double kSigmaRad = 0.02;
  const Eigen::Matrix3d information =
      Eigen::Vector3d(
          1.0 / (kSigmaM * kSigmaM), 1.0 / (kSigmaM * kSigmaM), 1.0 / (kSigmaRad * kSigmaRad))
          .asDiagonal();
  RandomSequence random(seed);
  std::vector<Pose2> truth = {Pose2{}};
  PoseGraph graph;
  graph.map_from_node = {Pose2{}};
  graph.fixed = {true};
  for (std::uint32_t i = 1; i < node_count; ++i) {
    const Pose2 step{4.0, 0.0, i % 5 == 0 ? 0.5 * kPi : 0.0};
    truth.push_back(truth.back() * step);
    const Pose2 measured = step * Noise(random, kSigmaM, kSigmaRad);
    graph.map_from_node.push_back(graph.map_from_node.back() * measured);
    graph.constraints.push_back({i - 1, i, measured, information, false});
    if (i >= kRound) {
      const Pose2 seen = Inverse(truth[i - kRound]) * truth[i];
      graph.constraints.push_back(
          {i - kRound, i, seen * Noise(random, kSigmaM, kSigmaRad), information, true});
    }
  }
  return graph;
}

// A robot that drives the streets of a town of square blocks, turning at random at each crossing,
// one node a crossing, tied to the last time that it was at the same crossing or at one beside it.
// The poses given are those of noisy odometry.
inline PoseGraph RandomManhattanGraph(std::uint64_t seed, std::uint32_t node_count) {
  constexpr int kBlocks = 12;  // in each direction
  constexpr double kBlockM = 1.0;
  constexpr double kSigmaM = 0.05;
  constexpr double kSigmaRad = 0.03;
  const Eigen::Matrix3d information =
      Eigen::Vector3d(
          1.0 / (kSigmaM * kSigmaM), 1.0 / (kSigmaM * kSigmaM), 1.0 / (kSigmaRad * kSigmaRad))
          .asDiagonal();
  RandomSequence random(seed);
  std::vector<std::uint32_t> last_at(kBlocks * kBlocks, node_count);
  std::vector<Pose2> truth;
  PoseGraph graph;
  graph.fixed = {true};
  const auto add = [&](std::uint32_t from, std::uint32_t to, bool robust) {
    const Pose2 seen = Inverse(truth[from]) * truth[to] * Noise(random, kSigmaM, kSigmaRad);
    graph.constraints.push_back({from, to, seen, information, robust});
  };
  int x = kBlocks / 2;
  int y = kBlocks / 2;
  int quarter = 0;  // turns of the robot, to the left
  for (std::uint32_t i = 0; i < node_count; ++i) {
    truth.push_back({kBlockM * x, kBlockM * y, WrapAngle(0.5 * kPi * quarter)});
    if (i == 0) {
      graph.map_from_node.push_back(truth.front());
    } else {
      add(i - 1, i, false);
      graph.map_from_node.push_back(graph.map_from_node.back() *
                                    graph.constraints.back().from_from_to);
    }
    for (const auto& [dx, dy] : {std::pair{0, 0}, {1, 0}, {0, 1}}) {
      const int seen_x = x + dx;
      const int seen_y = y + dy;
      if (seen_x < kBlocks && seen_y < kBlocks) {
        const std::uint32_t seen = last_at[static_cast<std::size_t>(seen_y * kBlocks + seen_x)];
        if (seen + 10 < i) {
          add(i, seen, true);
        }
      }
    }
    last_at[static_cast<std::size_t>(y * kBlocks + x)] = i;
    // Straight on more often than not; never out of the town.
    constexpr std::array<int, 6> kTurns = {0, 0, 0, 0, 1, 3};
    constexpr std::array<int, 4> kStepX = {1, 0, -1, 0};
    int next = 0;
    do {
      next = (quarter + kTurns[random.NextBits() % kTurns.size()]) % 4;
      const auto along = static_cast<std::size_t>(next);
      const int to_x = x + kStepX[along];
      const int to_y = y + kStepX[(along + 3) % 4];
      if (to_x >= 0 && to_x < kBlocks && to_y >= 0 && to_y < kBlocks) {
        x = to_x;
        y = to_y;
        break;
      }
    } while (true);
    quarter = next;
  }
  return graph;
}

// Adds points around the nodes, each seen from all nodes within 6 m of its maker.
inline void AddPoints(std::uint64_t seed, std::size_t count, PoseGraph& graph) {
  RandomSequence random(seed);
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t maker = random.NextBits() % graph.map_from_node.size();
    const Eigen::Vector2d point =
        graph.map_from_node[maker] *
        Eigen::Vector2d(random.NextUniform(-3.0, 3.0), random.NextUniform(-3.0, 3.0));
    graph.points_in_map.push_back(point);
    for (std::uint32_t i = 0; i < graph.map_from_node.size(); ++i) {
      const Eigen::Vector2d seen = Inverse(graph.map_from_node[i]) * point;
      if (seen.norm() < 6.0) {
        PointConstraint constraint;
        constraint.from = i;
        constraint.point = static_cast<std::uint32_t>(k);
        constraint.point_in_from =
            seen + 0.05 * Eigen::Vector2d(random.NextNormal(), random.NextNormal());
        constraint.information = 400.0 * Eigen::Matrix2d::Identity();
        graph.point_constraints.push_back(constraint);
      }
    }
  }
}

// Gives every third node a GNSS fix, and every tenth a pose in the map; noisy, about where the
// nodes are.
inline void AddPriors(std::uint64_t seed, PoseGraph& graph) {
  RandomSequence random(seed);
  for (std::uint32_t i = 0; i < graph.map_from_node.size(); ++i) {
    const Pose2& map_from_node = graph.map_from_node[i];
    if (i % 3 == 0) {
      Eigen::Matrix2d information;
      information << 4.0, 1.0, 1.0, 2.0;
      graph.position_priors.push_back(
          {i,
           map_from_node.translation() +
               0.5 * Eigen::Vector2d(random.NextNormal(), random.NextNormal()),
           information,
           false});
    }
    if (i % 10 == 0) {
      graph.pose_priors.push_back(
          {i, map_from_node * Noise(random, 0.2, 0.05), RandomInformation(random), false});
    }
  }
}

// All of a graph, with what its priors say, moved by one rigid motion.
inline PoseGraph Moved(const Pose2& new_from_old, PoseGraph graph) {
  for (PosePrior& prior : graph.pose_priors) {
    prior.map_from_node = new_from_old * prior.map_from_node;
  }
  Eigen::Matrix2d rotation;
  rotation << Cos(new_from_old.theta), -Sin(new_from_old.theta), Sin(new_from_old.theta),
      Cos(new_from_old.theta);
  for (PositionPrior& prior : graph.position_priors) {
    prior.node_in_map = new_from_old * prior.node_in_map;
    const Eigen::Matrix2d turned = rotation * prior.information * rotation.transpose();
    prior.information = 0.5 * (turned + turned.transpose());
  }
  for (Pose2& pose : graph.map_from_node) {
    pose = new_from_old * pose;
  }
  for (Eigen::Vector2d& point : graph.points_in_map) {
    point = new_from_old * point;
  }
  return graph;
}

}  // namespace loci
