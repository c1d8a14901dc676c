// SPDX-License-Identifier: Apache-2.0
#include "core/closure/place_match.h"

#include <gtest/gtest.h>

#include "tests/support/places.h"

namespace loci {
namespace {

const Pose2 kFirst{-1.5, -1.0, 0.2};
const Pose2 kSecond{0.8, 1.0, -2.6};

Place PlaceIn(const SimulatedWorld& world, const Pose2& map_from_place, std::uint64_t seed) {
  RandomSequence noise(seed);
  return FinishedPlace(
      world, map_from_place, KeyPoses(map_from_place, 1.5), FullTurnScanner(360), noise);
}

Eigen::Matrix3d Doubt(double sigma_m, double sigma_rad) {
  return Covariance3::FromSigmas(sigma_m, sigma_m, sigma_rad).matrix();
}

TEST(PlaceMatchTest, FindsAKnownRelativePoseFromAWrongPrediction) {
  const Place from = PlaceIn(FurnishedRoom(), kFirst, 1);
  const Place to = PlaceIn(FurnishedRoom(), kSecond, 2);
  const Pose2 truth = Inverse(kFirst) * kSecond;
  for (const Pose2& wrong : {Pose2{1.2, -0.8, 0.15}, Pose2{-1.5, 0.4, -0.2}}) {
    const std::optional<PlaceMatch> match =
        MatchPlaces(from, to, {truth * wrong, Doubt(1.0, 0.15)}, {}, 5);
    ASSERT_TRUE(match.has_value());
    EXPECT_EQ(match->reason, "");
    const Pose2 error = Inverse(truth) * match->from_from_to;
    EXPECT_LT(error.translation().norm(), 0.02);
    EXPECT_LT(std::abs(error.theta), 0.005);
    EXPECT_LT(match->covariance.matrix()(0, 0), 0.05 * 0.05);
  }
}

TEST(PlaceMatchTest, TheSameSeedGivesTheSameBits) {
  const Place from = PlaceIn(FurnishedRoom(), kFirst, 1);
  const Place to = PlaceIn(FurnishedRoom(), kSecond, 2);
  const PlacePrediction prediction{Inverse(kFirst) * kSecond, Doubt(0.5, 0.1)};
  const std::optional<PlaceMatch> a = MatchPlaces(from, to, prediction, {}, 5);
  const std::optional<PlaceMatch> b = MatchPlaces(from, to, prediction, {}, 5);
  ASSERT_TRUE(a.has_value() && b.has_value());
  EXPECT_EQ(a->from_from_to, b->from_from_to);
  EXPECT_EQ(a->covariance.matrix(), b->covariance.matrix());
}

// Rooms of 4 x 4 m in a row, all alike, along one side of a corridor.
SimulatedWorld IdenticalRooms() {
  SimulatedWorld world;
  world.AddWall({-40.0, -1.0}, {40.0, -1.0});
  for (int room = -9; room < 9; ++room) {
    const double x = 4.0 * room;
    world.AddWall({x, 1.0}, {x + 1.4, 1.0});
    world.AddWall({x + 2.6, 1.0}, {x + 4.0, 1.0});
    world.AddWall({x, 1.0}, {x, 5.0});
    world.AddWall({x, 5.0}, {x + 4.0, 5.0});
  }
  return world;
}

TEST(PlaceMatchTest, IdenticalRoomsAreRefusedForTheirSecondPeak) {
  const SimulatedWorld world = IdenticalRooms();
  const Pose2 first{-6.0, 0.0, 0.0};
  const Pose2 second{-1.6, 0.1, 0.05};
  RandomSequence noise(2);
  const Place from =
      FinishedPlace(world, first, KeyPoses(first, 12.0), FullTurnScanner(360), noise);
  // Sees a few rooms only: moved by one room it fits `from` as well as at its own place.
  Scanner short_sighted = FullTurnScanner(360);
  short_sighted.range_max_m = 6.0;
  const Place to = FinishedPlace(world, second, KeyPoses(second, 1.5), short_sighted, noise);
  const Pose2 truth = Inverse(first) * second;
  // One who is almost certain takes the right room; one who is not cannot tell them apart.
  const std::optional<PlaceMatch> certain = MatchPlaces(from, to, {truth, Doubt(0.1, 0.03)}, {}, 5);
  ASSERT_TRUE(certain.has_value());
  EXPECT_EQ(certain->reason, "");
  const std::optional<PlaceMatch> doubtful =
      MatchPlaces(from, to, {truth * Pose2{2.2, 0.0, 0.0}, Doubt(2.5, 0.05)}, {}, 5);
  ASSERT_TRUE(doubtful.has_value());
  EXPECT_GT(doubtful->second_peak_ratio, 0.9);
  EXPECT_NE(doubtful->reason.find("second peak"), std::string::npos);
}

TEST(PlaceMatchTest, AWallWhereTheOtherSawFreeSpaceIsRefused) {
  SimulatedWorld changed = FurnishedRoom();
  changed.AddWall({-1.5, 0.3}, {2.0, 0.3});  // a wall that was not there
  const Pose2 second{-1.2, -1.2, 0.0};
  const Place from = PlaceIn(FurnishedRoom(), kFirst, 1);
  const Place to = PlaceIn(changed, second, 2);
  const std::optional<PlaceMatch> match =
      MatchPlaces(from, to, {Inverse(kFirst) * second, Doubt(0.1, 0.03)}, {}, 5);
  ASSERT_TRUE(match.has_value());
  EXPECT_GT(match->agreement.free_conflict_fraction, 0.05);
  EXPECT_NE(match->reason, "");
}

TEST(PlaceMatchTest, TooLittleCommonGroundIsRefusedAndNothingAlikeIsNothing) {
  const Place from = PlaceIn(FurnishedRoom(), kFirst, 1);
  const Place to = PlaceIn(FurnishedRoom(), kSecond, 2);
  ClosureLimits limits;
  limits.overlap_min_m2 = 1000.0;
  const std::optional<PlaceMatch> match =
      MatchPlaces(from, to, {Inverse(kFirst) * kSecond, Doubt(0.1, 0.03)}, limits, 5);
  ASSERT_TRUE(match.has_value());
  EXPECT_NE(match->reason.find("overlap"), std::string::npos);
  EXPECT_FALSE(MatchPlaces(from, to, {{60.0, 0.0, 0.0}, Doubt(0.3, 0.1)}, {}, 5).has_value());
  EXPECT_FALSE(MatchPlaces(from, Place(), {{}, Doubt(0.3, 0.1)}, {}, 5).has_value());
}

}  // namespace
}  // namespace loci
