// SPDX-License-Identifier: Apache-2.0
#include "core/place/track.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "core/grid/occupancy_grid.h"
#include "core/matching/correlative_search.h"
#include "core/matching/line_registration.h"
#include "core/matching/scrim.h"
#include "core/scan/segment.h"

namespace loci {
namespace {

// A scan is matched once the robot has moved this far since the last; until then odometry is the
// better witness (notes on matching).
constexpr double kMatchStepM = 0.03;
constexpr double kMatchStepRad = 0.02;
// Key scans: design.md, section 2.
constexpr double kKeyStepM = 0.2;
constexpr double kKeyStepRad = 10.0 * kPi / 180.0;

constexpr std::size_t kPointsMin = 15;  // fewer say nothing about a pose
constexpr std::size_t kSearchPointsMax = 120;
constexpr std::size_t kRegistrationPointsMax = 360;
constexpr double kSlideMaxM = 0.3;           // of the registration, from the search's result
constexpr double kInlierFractionMin = 0.4;   // below, the match is not believed
constexpr double kLikelihoodMin = 0.35;      // below, a wider window is tried
constexpr std::uint32_t kUnmatchedMax = 10;  // scans; then the robot starts afresh
constexpr double kBlindLengthM = 100.0;      // of a place that holds no scan
constexpr double kMovingFraction = 0.7;      // of a segment's points in confidently free cells
constexpr std::size_t kMovingPointsMin = 3;

double Square(double value) {
  return value * value;
}

std::vector<Eigen::Vector2d> Thinned(std::span<const Eigen::Vector2d> points,
                                     std::size_t count_max) {
  const std::size_t step = std::max<std::size_t>(1, (points.size() + count_max - 1) / count_max);
  std::vector<Eigen::Vector2d> thinned;
  thinned.reserve(points.size() / step + 1);
  for (std::size_t i = 0; i < points.size(); i += step) {
    thinned.push_back(points[i]);
  }
  return thinned;
}

bool HasMoved(const Pose2& motion, double step_m, double step_rad) {
  return motion.translation().squaredNorm() > step_m * step_m || std::abs(motion.theta) > step_rad;
}

SearchWindow WindowOf(const Eigen::Matrix3d& covariance) {
  const double sigma_m = std::sqrt(std::max(covariance(0, 0), covariance(1, 1)));
  SearchWindow window;
  window.half_x_m = std::clamp(3.0 * sigma_m, 0.2, 0.5);
  window.half_y_m = window.half_x_m;
  window.half_theta_rad = std::clamp(3.0 * std::sqrt(covariance(2, 2)), 0.14, 0.35);
  return window;
}

// What a scan is made of, seen from its place.
struct SplitScan {
  std::vector<Eigen::Vector2d> stationary;  // in the robot's frame
  std::vector<Eigen::Vector2d> moving;
};

bool IsConfidentlyFree(LogOdds8 value) {
  return value != kUnobserved && value <= kConfidentlyFreeUnits;
}

// Where the robot's surroundings are known to be free: by this place, or by the one before where
// this one has not looked yet.
class FreeSpace {
 public:
  FreeSpace(const Place& place, const Place* previous, const Track& track, double cell_size_m)
      : place_(place.stationary),
        previous_(previous == nullptr ? nullptr : &previous->stationary),
        previous_from_place_(track.previous_from_place),
        cell_size_m_(cell_size_m) {}

  bool Contains(const Eigen::Vector2d& point_in_place) const {
    const LogOdds8 value = place_.At(CellOf(point_in_place, cell_size_m_));
    if (IsConfidentlyFree(value)) {
      return true;
    }
    // What this place took for occupied may be the very thing that moves.
    return previous_ != nullptr && IsConfidentlyFree(previous_->At(CellOf(
                                       previous_from_place_ * point_in_place, cell_size_m_)));
  }

 private:
  const LogOddsGrid& place_;
  const LogOddsGrid* previous_;
  Transformer2 previous_from_place_;
  double cell_size_m_;
};

// Segments whose points fall where the stationary grid is confidently free are moving (SCRIM,
// sections II.E and V).
SplitScan Split(std::span<const ScanPoint> points,
                const Pose2& place_from_robot,
                const FreeSpace& free_space) {
  SplitScan split;
  const Transformer2 transform(place_from_robot);
  for (const Segment& segment : SegmentByDistance(points, kSegmentGapM)) {
    std::size_t in_free = 0;
    for (std::size_t i = segment.begin; i < segment.end; ++i) {
      in_free += free_space.Contains(transform * points[i].point_in_robot) ? 1U : 0U;
    }
    const std::size_t size = segment.end - segment.begin;
    const bool is_moving =
        size >= kMovingPointsMin &&
        static_cast<double>(in_free) >= kMovingFraction * static_cast<double>(size);
    std::vector<Eigen::Vector2d>& target = is_moving ? split.moving : split.stationary;
    for (std::size_t i = segment.begin; i < segment.end; ++i) {
      target.push_back(points[i].point_in_robot);
    }
  }
  return split;
}

// Finds the robot in its place. Leaves the track as predicted if no match is believed.
SplitScan MatchScan(std::span<const ScanPoint> points,
                    const FreeSpace& free_space,
                    Track& track,
                    const Place& place) {
  std::vector<Eigen::Vector2d> all;
  all.reserve(points.size());
  for (const ScanPoint& point : points) {
    all.push_back(point.point_in_robot);
  }
  const std::vector<Eigen::Vector2d> search_points = Thinned(all, kSearchPointsMax);
  const Pose2 predicted = track.place_from_robot;
  CorrelativeMatch match =
      FindBestPose(search_points, predicted, WindowOf(track.covariance), track.likelihood);
  if (match.likelihood < kLikelihoodMin) {
    SearchWindow wide;
    wide.half_x_m = wide.half_y_m = 0.7;
    wide.half_theta_rad = 0.6;
    match = FindBestPose(search_points, predicted, wide, track.likelihood);
  }
  SplitScan split = Split(points, match.grid_from_robot, free_space);

  const std::vector<Eigen::Vector2d> registered = Thinned(split.stationary, kRegistrationPointsMax);
  RegistrationOptions options;
  options.prior_patch_from_robot = predicted;
  options.prior_information = track.covariance.inverse();
  const Registration registration =
      RegisterToLines(registered, match.grid_from_robot, place.patch, options);
  const Pose2 slide = Inverse(match.grid_from_robot) * registration.patch_from_robot;
  const bool believed = static_cast<double>(registration.inlier_count) >=
                            kInlierFractionMin * static_cast<double>(registered.size()) &&
                        registered.size() >= kPointsMin && slide.translation().norm() <= kSlideMaxM;
  if (!believed) {
    ++track.unmatched;
    return split;
  }
  track.unmatched = 0;
  track.place_from_robot = registration.patch_from_robot;
  track.matched_from_robot = {};
  const Eigen::Matrix3d posterior =
      (registration.information + options.prior_information).inverse();
  const Eigen::Vector3d floor(Square(0.01), Square(0.01), Square(0.005));
  track.covariance = 0.5 * (posterior + posterior.transpose());
  track.covariance.diagonal() += floor;
  return split;
}

// Cells that this scan saw through count a miss.
void CountMisses(const LaserScan& scan,
                 const Pose2& place_from_robot,
                 double range_max_m,
                 Patch& patch) {
  const Pose2 laser_from_place = Inverse(place_from_robot * scan.robot_from_laser);
  const Transformer2 transform(laser_from_place);
  const double margin_m = 3.0 * patch.cell_size_m();
  for (std::size_t i = 0; i < patch.cells().size(); ++i) {
    const Eigen::Vector2d mean = transform * patch.cells()[i].Mean();
    const double distance_m = mean.norm();
    if (distance_m > range_max_m) {
      continue;
    }
    const double angle = WrapAngle(Atan2(mean.y(), mean.x()) - scan.angle_min_rad);
    const double beam = (angle < 0.0 ? angle + 2.0 * kPi : angle) / scan.angle_step_rad;
    const std::size_t nearest = static_cast<std::size_t>(beam + 0.5);
    if (nearest >= scan.ranges_mm.size() || scan.ranges_mm[nearest] == LaserScan::kNothingSeen) {
      continue;
    }
    if (0.001 * scan.ranges_mm[nearest] > distance_m + margin_m) {
      patch.AddMiss(i);
    }
  }
}

std::uint64_t InsertKeyScan(const LaserScan& scan,
                            SplitScan split,
                            const PlaceSettings& settings,
                            Track& track,
                            Place& place) {
  CountMisses(scan, track.place_from_robot, settings.range_max_m, place.patch);
  std::uint64_t written = IntegrateScan(scan,
                                        split.stationary,
                                        track.place_from_robot,
                                        settings.range_max_m,
                                        settings.cell_size_m,
                                        place.stationary);
  written +=
      IntegrateMoving(split.moving, track.place_from_robot, settings.cell_size_m, place.moving);
  const Transformer2 transform(track.place_from_robot);
  for (const Eigen::Vector2d& point : split.stationary) {
    const Eigen::Vector2d in_place = transform * point;
    if (place.patch.Add(in_place, PatchContent::kOwn)) {
      track.likelihood.Add(CellOf(in_place, settings.cell_size_m));
    }
  }
  track.place_from_key = track.place_from_robot;
  track.matched_from_robot = {};
  track.has_key = true;
  track.recent_keys.push_back({track.place_from_robot, std::move(split.stationary)});
  if (track.recent_keys.size() > kHandOverKeys) {
    track.recent_keys.erase(track.recent_keys.begin());
  }
  return written;
}

}  // namespace

void Predict(const Pose2& previous_from_robot, const Eigen::Matrix3d& covariance, Track& track) {
  track.place_from_robot = track.place_from_robot * previous_from_robot;
  track.odom_from_robot = track.odom_from_robot * previous_from_robot;
  track.matched_from_robot = track.matched_from_robot * previous_from_robot;
  track.driven_m += previous_from_robot.translation().norm();
  const Eigen::Matrix3d adjoint = Adjoint(Inverse(previous_from_robot));
  const Eigen::Matrix3d moved = adjoint * track.covariance * adjoint.transpose() + covariance;
  track.covariance = 0.5 * (moved + moved.transpose());
}

std::uint64_t TakeScan(const LaserScan& scan,
                       const PlaceSettings& settings,
                       const Place* previous,
                       Track& track,
                       Place& place) {
  const std::vector<ScanPoint> points = ToPoints(scan, settings.range_max_m);
  if (points.size() < kPointsMin) {
    return 0;
  }
  SplitScan split;
  if (place.patch.cells().empty()) {
    for (const ScanPoint& point : points) {
      split.stationary.push_back(point.point_in_robot);
    }
    return InsertKeyScan(scan, std::move(split), settings, track, place);
  }
  const bool is_first = !track.has_key;
  if (!is_first && !HasMoved(track.matched_from_robot, kMatchStepM, kMatchStepRad)) {
    return 0;
  }
  split = MatchScan(points, FreeSpace(place, previous, track, settings.cell_size_m), track, place);
  const Pose2 since_key = Inverse(track.place_from_key) * track.place_from_robot;
  if (track.unmatched > 0 || (!is_first && !HasMoved(since_key, kKeyStepM, kKeyStepRad))) {
    return 0;
  }
  return InsertKeyScan(scan, std::move(split), settings, track, place);
}

bool WantsNewPlace(const Track& track, const PlaceSettings& settings) {
  // A place without a scan of its own costs nothing but its name, and is long rather than many;
  // yet it ends, so that what it will hold lies near its origin.
  const double length_m =
      track.has_key ? settings.place_length_m : std::max(settings.place_length_m, kBlindLengthM);
  return track.driven_m >= length_m || track.unmatched > kUnmatchedMax;
}

Eigen::Matrix3d HandOverCovariance(const Track& track, const Place& place, std::uint64_t seed) {
  // What the last key scan says is true of where it was taken; further on, odometry's doubt counts.
  const bool is_blind = HasMoved(track.matched_from_robot, kKeyStepM, kKeyStepRad);
  if (track.unmatched > 0 || track.recent_keys.empty() || is_blind) {
    return track.covariance;
  }
  SamplingOptions options;
  options.seed = seed;
  const KeyScan& last = track.recent_keys.back();
  return SampleMatchCovariance(
             last.points_in_robot, last.place_from_robot, place.patch, track.likelihood, options)
      .matrix();
}

Pose2 HandOver(Place& next, Track& track) {
  const Pose2 old_from_next = track.place_from_robot;
  const Pose2 next_from_old = Inverse(old_from_next);
  const bool is_lost = track.unmatched > 0;
  if (is_lost) {
    track.recent_keys.clear();  // they would only mislead
  }
  track.likelihood = LikelihoodGrid({{-64, -64}, {64, 64}}, next.patch.cell_size_m());
  for (KeyScan& key : track.recent_keys) {
    key.place_from_robot = next_from_old * key.place_from_robot;
    const Transformer2 transform(key.place_from_robot);
    for (const Eigen::Vector2d& point : key.points_in_robot) {
      const Eigen::Vector2d in_place = transform * point;
      if (next.patch.Add(in_place, PatchContent::kReference)) {
        track.likelihood.Add(CellOf(in_place, next.patch.cell_size_m()));
      }
    }
  }
  if (is_lost) {
    track.previous.reset();
  } else {
    track.previous = track.place;
  }
  track.previous_from_place = old_from_next;
  track.place = next.id;
  track.place_from_robot = {};
  track.place_from_key = {};
  track.matched_from_robot = {};
  track.has_key = false;
  track.driven_m = 0.0;
  track.unmatched = 0;
  track.covariance = Covariance3::FromSigmas(0.02, 0.02, 0.01).matrix();
  return old_from_next;
}

void RebuildCaches(const Place& place, Track& track) {
  track.likelihood = LikelihoodGrid::OfPatch(place.patch, 1);
}

}  // namespace loci
