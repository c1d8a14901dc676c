// SPDX-License-Identifier: Apache-2.0
// False closures for tests and benchmarks, and how well they were told from the true ones.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/se2.h"
#include "core/graph/pose_graph.h"

namespace loci {

struct FalseClosureOptions {
  std::uint64_t seed = 1;
  std::size_t count = 1000;
  // Closures in a row along the path that agree with each other, as where two streets look alike;
  // 1: each for itself.
  std::size_t run_length = 1;
};

// Adds false closures to a graph whose poses are the clean optimum, behind its constraints.
//
// A false closure joins any two nodes by the measurement and the information of a true closure
// drawn by lot: nothing but the rest of the graph tells it. In a run, the next ones join the next
// nodes, of the second end forwards or backwards, by what makes them agree with the first exactly.
// One that would fit the clean optimum (chi2 below 25, which a true one exceeds once in 65000) is
// no false one, and is drawn again with its run.
inline void AddFalseClosures(const FalseClosureOptions& options, PoseGraph& optimum) {
  constexpr double kFitsChi2 = 25.0;
  std::vector<GraphConstraint> closures;
  for (const GraphConstraint& constraint : optimum.constraints) {
    if (constraint.robust) {
      closures.push_back(constraint);
    }
  }
  RandomSequence random(options.seed);
  const std::vector<Pose2>& poses = optimum.map_from_node;
  const auto node_count = static_cast<std::int64_t>(poses.size());
  const std::size_t wanted = optimum.constraints.size() + options.count;
  const auto index = [&](std::size_t count) {
    return static_cast<std::int64_t>(random.NextUnit() * static_cast<double>(count));
  };
  while (optimum.constraints.size() < wanted) {
    const std::int64_t from = index(poses.size());
    const std::int64_t to = index(poses.size());
    const GraphConstraint& like = closures[static_cast<std::size_t>(index(closures.size()))];
    const std::int64_t direction = random.NextUnit() < 0.5 ? -1 : 1;
    const Pose2 from_from_to = like.from_from_to;
    std::vector<GraphConstraint> run;
    for (std::size_t k = 0; k < options.run_length; ++k) {
      const std::int64_t a = from + static_cast<std::int64_t>(k);
      const std::int64_t b = to + direction * static_cast<std::int64_t>(k);
      if (a >= node_count || b < 0 || b >= node_count || std::abs(a - b) <= 1) {
        break;
      }
      const auto at = [&](std::int64_t node) { return poses[static_cast<std::size_t>(node)]; };
      GraphConstraint closure = like;
      closure.from = static_cast<std::uint32_t>(a);
      closure.to = static_cast<std::uint32_t>(b);
      closure.from_from_to = Inverse(at(a)) * at(from) * from_from_to * Inverse(at(to)) * at(b);
      if (Chi2Of(optimum, closure) < kFitsChi2) {
        break;
      }
      run.push_back(closure);
    }
    if (run.size() == options.run_length) {
      const std::size_t room = wanted - optimum.constraints.size();
      run.resize(std::min(run.size(), room));
      optimum.constraints.insert(optimum.constraints.end(), run.begin(), run.end());
    }
  }
}

// Poses that follow from odometry, so that nothing of an optimum is left in them.
inline void PlaceByOdometry(PoseGraph& graph) {
  for (const GraphConstraint& constraint : graph.constraints) {
    if (!constraint.robust && constraint.to == constraint.from + 1) {
      graph.map_from_node[constraint.to] =
          graph.map_from_node[constraint.from] * constraint.from_from_to;
    }
  }
}

// How well the true closures were told from the false ones, and the map from the clean one.
struct RobustScore {
  double precision = 0.0;  // accepted closures that are true / accepted closures
  double recall = 0.0;     // the same / true closures
  double rms_m = 0.0;      // of the nodes' positions
};

// `accepted` and `result` of a graph made by AddFalseClosures from `optimum`.
inline RobustScore ScoreOf(const PoseGraph& optimum,
                           const PoseGraph& result,
                           const std::vector<bool>& accepted) {
  std::size_t true_count = 0;
  std::size_t accepted_count = 0;
  std::size_t accepted_true_count = 0;
  for (std::size_t i = 0; i < result.constraints.size(); ++i) {
    if (result.constraints[i].robust) {
      const bool is_true = i < optimum.constraints.size();
      true_count += is_true ? 1U : 0U;
      accepted_count += accepted[i] ? 1U : 0U;
      accepted_true_count += is_true && accepted[i] ? 1U : 0U;
    }
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < optimum.map_from_node.size(); ++i) {
    sum += (result.map_from_node[i].translation() - optimum.map_from_node[i].translation())
               .squaredNorm();
  }
  const auto part = [](std::size_t of, std::size_t all) {
    return all == 0 ? 1.0 : static_cast<double>(of) / static_cast<double>(all);
  };
  return {part(accepted_true_count, accepted_count),
          part(accepted_true_count, true_count),
          std::sqrt(sum / static_cast<double>(optimum.map_from_node.size()))};
}

// A robot that drives around the blocks of a town, turns at random, and closes a loop wherever it
// passes a corner again: as the public Manhattan worlds, but from a seed. The poses given are those
// of noisy odometry; node 0 is fixed. The stated covariances are those of the noise.
inline PoseGraph ManhattanWorld(std::uint64_t seed, std::uint32_t node_count) {
  constexpr double kSigmaM = 0.02;
  constexpr double kSigmaRad = 0.01;
  constexpr int kBlocks = 12;          // the town is so many blocks wide and high
  constexpr std::uint32_t kBlock = 4;  // steps of 1 m
  constexpr std::uint32_t kGapMin = 20;
  const Eigen::Matrix3d information =
      Eigen::Vector3d(
          1.0 / (kSigmaM * kSigmaM), 1.0 / (kSigmaM * kSigmaM), 1.0 / (kSigmaRad * kSigmaRad))
          .asDiagonal();
  RandomSequence random(seed);
  const auto noisy = [&](const Pose2& pose) {
    return pose * Pose2{kSigmaM * random.NextNormal(),
                        kSigmaM * random.NextNormal(),
                        kSigmaRad * random.NextNormal()};
  };
  std::vector<Pose2> truth = {Pose2{}};
  PoseGraph graph;
  graph.map_from_node = {Pose2{}};
  graph.fixed = {true};
  const auto inside = [](const Pose2& pose) {
    const double size = kBlocks * static_cast<double>(kBlock) + 0.5;
    return pose.x > -0.5 && pose.y > -0.5 && pose.x < size && pose.y < size;
  };
  for (std::uint32_t i = 1; i < node_count; ++i) {
    Pose2 step{1.0, 0.0, 0.0};
    if (i % kBlock == 0) {
      do {
        step.theta = 0.5 * kPi * (std::floor(3.0 * random.NextUnit()) - 1.0);
      } while (!inside(truth.back() * step * Pose2{static_cast<double>(kBlock), 0.0, 0.0}));
    }
    truth.push_back(truth.back() * step);
    const Pose2 measured = noisy(step);
    graph.map_from_node.push_back(graph.map_from_node.back() * measured);
    graph.constraints.push_back({i - 1, i, measured, information, false});
    // The latest pass of the same spot only.
    for (std::uint32_t j = i; j-- > 0;) {
      if ((truth[i].translation() - truth[j].translation()).norm() < 0.1 && i - j >= kGapMin) {
        graph.constraints.push_back({j, i, noisy(Inverse(truth[j]) * truth[i]), information, true});
        break;
      }
    }
  }
  return graph;
}

}  // namespace loci
