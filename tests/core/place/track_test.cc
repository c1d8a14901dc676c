// SPDX-License-Identifier: Apache-2.0
#include "core/place/track.h"

#include <gtest/gtest.h>

#include "core/grid/occupancy_grid.h"
#include "tests/support/generator.h"
#include "tests/support/grids.h"

namespace loci {
namespace {

// A robot in a place whose frame is the robot's first pose.
struct Drive {
  Track track;
  Place place;
  PlaceSettings settings;
  Pose2 map_from_place;
  std::uint64_t written = 0;

  Pose2 Estimate() const { return map_from_place * track.place_from_robot; }
};

Drive Begin(const Pose2& map_from_place) {
  Drive run;
  run.map_from_place = map_from_place;
  run.settings.place_length_m = 1000.0;
  run.track.covariance = Covariance3::FromSigmas(0.02, 0.02, 0.01).matrix();
  RebuildCaches(run.place, run.track);
  return run;
}

void Take(const ObservationEvent& event, Drive& run) {
  if (event.odometry.has_value()) {
    Predict(event.odometry->previous_from_robot,
            SymmetricFromUpper(event.odometry->covariance_upper),
            run.track);
  }
  if (event.scan.has_value()) {
    run.written += TakeScan(*event.scan, run.settings, nullptr, run.track, run.place);
  }
}

// Goes on in a new place.
Pose2 GoOn(PlaceId id, Drive& run) {
  Place next;
  next.id = id;
  const Pose2 old_from_next = HandOver(next, run.track);
  run.map_from_place = run.map_from_place * old_from_next;
  run.place = std::move(next);
  return old_from_next;
}

std::vector<Pose2> RoundInTheRoom() {
  return DriveAlong({{-1.5, -1.5}, {1.0, -1.5}, {1.0, 0.8}, {-1.5, 0.8}, {-1.5, -1.5}}, 0.1);
}

void ExpectNear(const Pose2& estimate, const Pose2& truth, double metres, double radians) {
  const Pose2 error = Inverse(truth) * estimate;
  EXPECT_LT(error.translation().norm(), metres);
  EXPECT_LT(std::abs(error.theta), radians);
}

TEST(TrackTest, FollowsARobotWhoseOdometryDrifts) {
  const std::vector<Pose2> poses = RoundInTheRoom();
  const DriftOptions drift{.scale = 1.05, .turn_rad_per_m = 0.08, .sigma_part = 0.05};
  Drive run = Begin(poses[0]);
  const std::vector<Event> events =
      ObservationsAlong(FurnishedRoom(), poses, Scanner(), drift, SessionId{0}, 1);
  for (std::size_t i = 0; i < events.size(); ++i) {
    Take(std::get<ObservationEvent>(events[i]), run);
    SCOPED_TRACE(i);
    ExpectNear(run.Estimate(), poses[i], 0.04, 0.015);
    EXPECT_EQ(run.track.unmatched, 0U);
  }
  const Pose2 dead_reckoning = poses[0] * run.track.odom_from_robot;
  EXPECT_GT((Inverse(poses.back()) * dead_reckoning).translation().norm(), 0.3);
  EXPECT_GT(run.written, 10000U);
}

TEST(TrackTest, TheCovarianceStaysACovariance) {
  const std::vector<Pose2> poses = RoundInTheRoom();
  Drive run = Begin(poses[0]);
  for (const Event& event :
       ObservationsAlong(FurnishedRoom(), poses, Scanner(), {}, SessionId{0}, 2)) {
    Take(std::get<ObservationEvent>(event), run);
    EXPECT_TRUE(Covariance3::FromMatrix(run.track.covariance, "track").ok());
    EXPECT_LT(run.track.covariance(0, 0), 0.03 * 0.03);
  }
}

TEST(TrackTest, AMovingThingGoesIntoTheMovingGridOnly) {
  Drive run = Begin({});
  RandomSequence noise(3);
  std::vector<Eigen::Vector2d> walked;
  Pose2 pose;
  for (int i = 0; i < 30; ++i) {
    SimulatedWorld world;
    world.AddBox({-5.0, -4.0}, {5.0, 4.0});
    if (i >= 10) {  // somebody walks in when the room is known to be free
      const Eigen::Vector2d at(2.0, -1.5 + 0.15 * (i - 10));
      world.AddBox(at - Eigen::Vector2d(0.2, 0.2), at + Eigen::Vector2d(0.2, 0.2));
      walked.emplace_back(at.x() - 0.2, at.y());
    }
    const Pose2 next{-0.21 * (i % 10), 0.0, 0.0};
    ObservationEvent event;
    event.odometry = DriftingOdometry(Inverse(pose) * next, {}, noise);
    event.scan = world.Scan(next, Scanner(), noise);
    pose = next;
    Take(event, run);
  }
  ExpectNear(run.Estimate(), pose, 0.05, 0.02);
  EXPECT_GT(ObservedCount(run.place.moving), 20U);
  const double cell_m = run.settings.cell_size_m;
  for (const Eigen::Vector2d& at : walked) {
    EXPECT_LE(run.place.stationary.At(CellOf(at, cell_m)), 0);
  }
}

TEST(TrackTest, HandOverKeepsThePoseAndGoesOnMatching) {
  const std::vector<Pose2> poses = RoundInTheRoom();
  Drive run = Begin(poses[0]);
  const std::vector<Event> events = ObservationsAlong(
      FurnishedRoom(), poses, Scanner(), {.turn_rad_per_m = 0.05}, SessionId{0}, 4);
  for (std::size_t i = 0; i < events.size(); ++i) {
    Take(std::get<ObservationEvent>(events[i]), run);
    if (i == events.size() / 2) {
      const Pose2 before = run.Estimate();
      const Pose2 odom_before = run.track.odom_from_robot;
      GoOn(PlaceId{1}, run);
      EXPECT_EQ(run.track.place_from_robot, Pose2());
      EXPECT_EQ(run.track.place, PlaceId{1});
      EXPECT_EQ(run.track.odom_from_robot, odom_before);
      ExpectNear(run.Estimate(), before, 1e-12, 1e-12);
      EXPECT_GT(run.place.patch.cells().size(), 200U);  // reference content
      EXPECT_EQ(run.place.patch.cells()[0].own_hits, 0U);
      EXPECT_EQ(ObservedCount(run.place.stationary), 0U);  // which does not vote
    }
    SCOPED_TRACE(i);
    ExpectNear(run.Estimate(), poses[i], 0.05, 0.02);
  }
}

TEST(TrackTest, CachesMadeFromTheStateGoOnToTheSameBits) {
  const std::vector<Pose2> poses = RoundInTheRoom();
  const std::vector<Event> events =
      ObservationsAlong(FurnishedRoom(), poses, Scanner(), {}, SessionId{0}, 5);
  Drive run = Begin(poses[0]);
  Drive rebuilt = Begin(poses[0]);
  for (std::size_t i = 0; i < events.size(); ++i) {
    Take(std::get<ObservationEvent>(events[i]), run);
    RebuildCaches(rebuilt.place, rebuilt.track);
    Take(std::get<ObservationEvent>(events[i]), rebuilt);
    ASSERT_EQ(run.track.place_from_robot, rebuilt.track.place_from_robot) << i;
  }
}

TEST(TrackTest, ALostRobotStartsAfreshAlsoWhenItWasLostRightAfterAHandOver) {
  RandomSequence noise(6);
  SimulatedWorld elsewhere;  // nothing of it fits what the place holds
  elsewhere.AddBox({-1.0, -1.1}, {1.2, 0.9});
  for (const bool handed_over : {false, true}) {
    Drive run = Begin({});
    TakeScan(
        FurnishedRoom().Scan({}, Scanner(), noise), run.settings, nullptr, run.track, run.place);
    if (handed_over) {
      GoOn(PlaceId{1}, run);
    }
    int scans = 0;
    while (!WantsNewPlace(run.track, run.settings) && scans < 50) {
      Predict({0.1, 0.0, 0.1}, Covariance3::FromSigmas(0.02, 0.02, 0.02).matrix(), run.track);
      const LaserScan scan = elsewhere.Scan({0.0, 0.0, 0.1 * scans}, Scanner(), noise);
      TakeScan(scan, run.settings, nullptr, run.track, run.place);
      ++scans;
    }
    EXPECT_LT(scans, 50) << handed_over;
    GoOn(PlaceId{2}, run);
    EXPECT_TRUE(run.place.patch.cells().empty()) << handed_over;  // it would only mislead
  }
}

TEST(TrackTest, ARobotThatDroveBlindDoesNotClaimToBeCertainAtHandOver) {
  RandomSequence noise(7);
  Drive run = Begin({});
  TakeScan(FurnishedRoom().Scan({}, Scanner(), noise), run.settings, nullptr, run.track, run.place);
  for (int i = 0; i < 20; ++i) {
    Predict({0.1, 0.0, 0.0}, Covariance3::FromSigmas(0.05, 0.05, 0.02).matrix(), run.track);
  }
  const Eigen::Matrix3d covariance = HandOverCovariance(run.track, run.place, 1);
  EXPECT_GE(covariance(0, 0), 20 * 0.05 * 0.05);
}

TEST(TrackTest, WithoutAScanAPlaceStillEndsSomewhere) {
  Drive run = Begin({});
  run.settings.place_length_m = 5.0;
  double driven_m = 0.0;
  while (!WantsNewPlace(run.track, run.settings) && driven_m < 1000.0) {
    Predict({0.5, 0.0, 0.0}, Covariance3::FromSigmas(0.02, 0.02, 0.02).matrix(), run.track);
    driven_m += 0.5;
  }
  EXPECT_GT(driven_m, 50.0);  // it holds nothing: it may be long
  EXPECT_LT(driven_m, 500.0);
}

TEST(TrackTest, ScansThatSayNothingChangeNothing) {
  Drive run = Begin({});
  LaserScan scan;
  scan.angle_step_rad = 0.01;
  scan.ranges_mm.assign(180, LaserScan::kNothingSeen);
  EXPECT_EQ(TakeScan(scan, run.settings, nullptr, run.track, run.place), 0U);
  EXPECT_FALSE(run.track.has_key);
  EXPECT_TRUE(run.place.patch.cells().empty());
}

}  // namespace
}  // namespace loci
