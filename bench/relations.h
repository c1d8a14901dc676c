// SPDX-License-Identifier: Apache-2.0
// The relations error of a trajectory (Kuemmerle et al. 2009): for pairs of stamps whose relative
// pose is known, the distance of the trajectory's relative pose to it.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "core/engine/snapshot.h"

namespace loci {

struct StampedPose {
  double stamp_s = 0.0;
  Pose2 pose;
};

struct Relation {
  double first_s = 0.0;
  double second_s = 0.0;
  Pose2 first_from_second;
};

struct RelationsError {
  std::size_t matched = 0;
  std::size_t unmatched = 0;
  double mean_m = 0.0;
  double max_m = 0.0;
  double mean_deg = 0.0;
  double max_deg = 0.0;
};

inline std::vector<StampedPose> PosesOf(const Snapshot& snapshot) {
  std::vector<StampedPose> poses;
  for (const auto& piece : snapshot.sessions[0].trajectory) {
    for (const TrajectoryPose& pose : *piece) {
      poses.push_back({1e-9 * static_cast<double>(pose.stamp_ns),
                       snapshot.places[pose.place.value].map_from_place * pose.place_from_robot});
    }
  }
  return poses;
}

inline std::vector<Relation> ReadRelations(const std::filesystem::path& path) {
  std::vector<Relation> relations;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    Relation relation;
    double ignored = 0.0;
    if (words >> relation.first_s >> relation.second_s >> relation.first_from_second.x >>
        relation.first_from_second.y >> ignored >> ignored >> ignored >>
        relation.first_from_second.theta) {
      relations.push_back(relation);  // other lines are comments
    }
  }
  return relations;
}

// The pose at a stamp, between its neighbours; nothing if both are further than half a second.
inline std::optional<Pose2> PoseAt(const std::vector<StampedPose>& poses, double stamp_s) {
  constexpr double kGapMaxS = 0.5;
  const auto after = std::lower_bound(
      poses.begin(), poses.end(), stamp_s, [](const StampedPose& pose, double stamp) {
        return pose.stamp_s < stamp;
      });
  if (after == poses.begin() || after == poses.end()) {
    const StampedPose& nearest = after == poses.begin() ? poses.front() : poses.back();
    return std::abs(nearest.stamp_s - stamp_s) <= kGapMaxS ? std::optional(nearest.pose)
                                                           : std::nullopt;
  }
  const StampedPose& a = *(after - 1);
  const StampedPose& b = *after;
  if (std::min(stamp_s - a.stamp_s, b.stamp_s - stamp_s) > kGapMaxS) {
    return std::nullopt;
  }
  const double part = (stamp_s - a.stamp_s) / (b.stamp_s - a.stamp_s);
  return Pose2{a.pose.x + part * (b.pose.x - a.pose.x),
               a.pose.y + part * (b.pose.y - a.pose.y),
               WrapAngle(a.pose.theta + part * WrapAngle(b.pose.theta - a.pose.theta))};
}

inline RelationsError ErrorOf(const std::vector<StampedPose>& poses,
                              const std::vector<Relation>& relations) {
  RelationsError error;
  for (const Relation& relation : relations) {
    const std::optional<Pose2> first = PoseAt(poses, relation.first_s);
    const std::optional<Pose2> second = PoseAt(poses, relation.second_s);
    if (!first.has_value() || !second.has_value()) {
      ++error.unmatched;
      continue;
    }
    const Pose2 difference = Inverse(relation.first_from_second) * (Inverse(*first) * *second);
    const double metres = difference.translation().norm();
    const double degrees = std::abs(difference.theta) * 180.0 / kPi;
    ++error.matched;
    error.mean_m += metres;
    error.max_m = std::max(error.max_m, metres);
    error.mean_deg += degrees;
    error.max_deg = std::max(error.max_deg, degrees);
  }
  const double count = static_cast<double>(std::max<std::size_t>(error.matched, 1));
  error.mean_m /= count;
  error.mean_deg /= count;
  return error;
}

}  // namespace loci
