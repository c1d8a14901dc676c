// SPDX-License-Identifier: Apache-2.0
// Following a robot through its present place: prediction, matching, key scans.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/base/ids.h"
#include "core/geometry/covariance.h"
#include "core/geometry/eigen_fields.h"
#include "core/geometry/se2.h"
#include "core/matching/likelihood_grid.h"
#include "core/place/place.h"
#include "core/scan/scan_points.h"

namespace loci {

// A scan that was inserted into its place; the last ones are handed over to the next place.
struct KeyScan {
  Pose2 place_from_robot;
  std::vector<Eigen::Vector2d> points_in_robot;  // stationary ones
};

template <typename Archive>
void Fields(Archive& archive, KeyScan& key) {
  archive(key.place_from_robot, key.points_in_robot);
}

// Where a robot is in its place, and what is needed to go on from there.
struct Track {
  PlaceId place;
  Pose2 place_from_robot;
  // Of place_from_robot: (x, y, theta), right perturbation.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Pose2 odom_from_robot;             // sum of the odometry since the session began
  Pose2 matched_from_robot;          // motion since the last scan that was matched
  Pose2 place_from_key;              // of the last key scan
  bool has_key = false;              // false until the place holds a scan
  double driven_m = 0.0;             // in this place
  std::uint32_t unmatched = 0;       // scans in a row that could not be matched
  std::vector<KeyScan> recent_keys;  // the last kHandOverKeys of this place and those before

  // The place before this one, whose free space is still trusted: a new place knows none yet, and
  // would take a person for a pillar.
  std::optional<PlaceId> previous;
  Pose2 previous_from_place;

  // Cache: made from the place's patch.
  LikelihoodGrid likelihood;
};

// Handed over to the next place (design.md, section 4.8).
inline constexpr std::size_t kHandOverKeys = 15;

template <typename Archive>
void Fields(Archive& archive, Track& track) {
  archive(track.place, track.place_from_robot, track.covariance, track.odom_from_robot);
  archive(track.matched_from_robot, track.place_from_key, track.has_key, track.driven_m);
  archive(track.unmatched, track.recent_keys, track.previous, track.previous_from_place);
}

// The map's settings that concern places; see MapSettings.
struct PlaceSettings {
  double cell_size_m = 0.05;
  double place_length_m = 5.0;
  double range_max_m = 15.0;
};

// Moves the robot by its odometry, and its uncertainty with it. The covariance is that of the
// motion: (x, y, theta), right perturbation.
void Predict(const Pose2& previous_from_robot, const Eigen::Matrix3d& covariance, Track& track);

// Matches a scan against the place, corrects the robot, and inserts the scan if it is a key scan.
// `previous` is the place that track.previous names, or null. Returns the number of cells written.
std::uint64_t TakeScan(const LaserScan& scan,
                       const PlaceSettings& settings,
                       const Place* previous,
                       Track& track,
                       Place& place);

// Whether the robot should go on in a new place: driven far enough (without a scan of its own a
// place may be longer), or lost in this one.
bool WantsNewPlace(const Track& track, const PlaceSettings& settings);

// How certain the robot's pose in its place is: SCRIM's sampled covariance of the last key scan
// where that was matched and is near; the predicted covariance where not, which is symmetric, and
// positive definite but for rounding.
Eigen::Matrix3d HandOverCovariance(const Track& track, const Place& place, std::uint64_t seed);

// Continues in `next`, an empty place whose frame is the robot's present pose: the recent key scans
// go into it as reference content. Returns the robot's pose in the old place, the new one's frame.
Pose2 HandOver(Place& next, Track& track);

// Makes the caches of a track that was read from a checkpoint.
void RebuildCaches(const Place& place, Track& track);

}  // namespace loci
