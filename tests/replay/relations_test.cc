// SPDX-License-Identifier: Apache-2.0
// The relations error (Kuemmerle et al. 2009) of maps of real logs: for pairs of stamps whose
// relative pose is known, the distance of the trajectory's relative pose to it.
//
// The logs are not part of the project: the folder named by LOCI_DATASETS, or ../shared/datasets
// beside the source tree, holds carmen/LOG.clf.bz2 and carmen/LOG.relations. Skipped without.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "bench/map_of_log.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

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
  double mean_deg = 0.0;
};

// What a log must reach with the default settings.
struct Demand {
  std::string log;
  std::string relations;
  double mean_m;
  double mean_deg;
};

void PrintTo(const Demand& demand, std::ostream* out) {
  *out << demand.log;
}

std::filesystem::path CarmenFolder() {
  const char* named = std::getenv("LOCI_DATASETS");
  return std::filesystem::path(named != nullptr ? named : LOCI_DATASETS_BESIDE_SOURCE) / "carmen";
}

std::vector<StampedPose> PosesOf(const Snapshot& snapshot) {
  std::vector<StampedPose> poses;
  for (const auto& piece : snapshot.sessions[0].trajectory) {
    for (const TrajectoryPose& pose : *piece) {
      poses.push_back({1e-9 * static_cast<double>(pose.stamp_ns),
                       snapshot.places[pose.place.value].map_from_place * pose.place_from_robot});
    }
  }
  return poses;
}

std::vector<Relation> ReadRelations(const std::filesystem::path& path) {
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
std::optional<Pose2> PoseAt(const std::vector<StampedPose>& poses, double stamp_s) {
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

RelationsError ErrorOf(const std::vector<StampedPose>& poses,
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
    ++error.matched;
    error.mean_m += difference.translation().norm();
    error.mean_deg += std::abs(difference.theta) * 180.0 / kPi;
  }
  const double count = static_cast<double>(std::max<std::size_t>(error.matched, 1));
  error.mean_m /= count;
  error.mean_deg /= count;
  return error;
}

class RelationsTest : public testing::TestWithParam<Demand> {};

TEST_P(RelationsTest, TheMapOfARealLogIsAsExactAsPromised) {
  const Demand& demand = GetParam();
  const std::filesystem::path log = CarmenFolder() / (demand.log + ".clf.bz2");
  if (!std::filesystem::exists(log)) {
    GTEST_SKIP() << log << " is missing; LOCI_DATASETS names the folder that has carmen/";
  }
  const std::vector<Relation> relations = ReadRelations(CarmenFolder() / demand.relations);
  ASSERT_GT(relations.size(), 100U);
  const StatusOr<std::shared_ptr<const Snapshot>> snapshot = MapOfLog(log.string());
  ASSERT_THAT(snapshot, IsOk());
  const RelationsError error = ErrorOf(PosesOf(**snapshot), relations);
  RecordProperty("mean_m", std::to_string(error.mean_m));
  RecordProperty("mean_deg", std::to_string(error.mean_deg));
  EXPECT_LE(error.mean_m, demand.mean_m);
  EXPECT_LE(error.mean_deg, demand.mean_deg);
  EXPECT_LE(static_cast<double>(error.unmatched), 0.02 * static_cast<double>(relations.size()));
  EXPECT_EQ((*snapshot)->cells_written.closure, 0U);
}

INSTANTIATE_TEST_SUITE_P(
    Logs,
    RelationsTest,
    testing::Values(Demand{"intel", "intel.relations", 0.030, 0.45},
                    Demand{"aces", "aces.relations", 0.045, 0.45},
                    Demand{"mit-csail", "mit-csail.pseudo.relations", 0.060, 1.2}),
    [](const auto& instance) {
      std::string name = instance.param.log;
      std::replace(name.begin(), name.end(), '-', '_');
      return name;
    });

}  // namespace
}  // namespace loci
