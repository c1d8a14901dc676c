// SPDX-License-Identifier: Apache-2.0
#include "core/closure/hausdorff.h"

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

TEST(HausdorffTest, TwoViewsOfOneRoomAgreeAtTheirTruePose) {
  const Place from = PlaceIn(FurnishedRoom(), kFirst, 1);
  const Place to = PlaceIn(FurnishedRoom(), kSecond, 2);
  const Agreement agreement = CompareFinishedPlaces(from, to, Inverse(kFirst) * kSecond);
  EXPECT_GT(agreement.hausdorff_fraction, 0.9);
  EXPECT_LT(agreement.free_conflict_fraction, 0.02);
  EXPECT_GT(agreement.overlap_m2, 40.0);
  EXPECT_LT(agreement.overlap_m2, 85.0);
}

TEST(HausdorffTest, APlaceAgreesWithItself) {
  const Place place = PlaceIn(FurnishedRoom(), kFirst, 1);
  const Agreement agreement = CompareFinishedPlaces(place, place, {});
  EXPECT_EQ(agreement.hausdorff_fraction, 1.0);
  EXPECT_EQ(agreement.free_conflict_fraction, 0.0);
}

TEST(HausdorffTest, TheOrderOfTheTwoMakesNoDifference) {
  const Place from = PlaceIn(FurnishedRoom(), kFirst, 1);
  const Place to = PlaceIn(FurnishedRoom(), kSecond, 2);
  RandomSequence random(3);
  for (int i = 0; i < 10; ++i) {
    const Pose2 pose = Inverse(kFirst) * kSecond *
                       Pose2{random.NextNormal(), random.NextNormal(), 0.3 * random.NextNormal()};
    const Agreement forth = CompareFinishedPlaces(from, to, pose);
    const Agreement back = CompareFinishedPlaces(to, from, Inverse(pose));
    EXPECT_NEAR(forth.hausdorff_fraction, back.hausdorff_fraction, 1e-2);
    EXPECT_NEAR(forth.free_conflict_fraction, back.free_conflict_fraction, 1e-2);
    EXPECT_NEAR(forth.overlap_m2, back.overlap_m2, 0.05 * forth.overlap_m2 + 0.5);
  }
}

TEST(HausdorffTest, FractionsAreFractionsAtAnyPose) {
  const Place from = PlaceIn(FurnishedRoom(), kFirst, 1);
  const Place to = PlaceIn(FurnishedRoom(), kSecond, 2);
  RandomSequence random(4);
  for (int i = 0; i < 40; ++i) {
    const Pose2 pose{
        random.NextUniform(-30.0, 30.0), random.NextUniform(-30.0, 30.0), random.NextNormal()};
    const Agreement agreement = CompareFinishedPlaces(from, to, pose);
    EXPECT_GE(agreement.hausdorff_fraction, 0.0);
    EXPECT_LE(agreement.hausdorff_fraction, 1.0);
    EXPECT_GE(agreement.free_conflict_fraction, 0.0);
    EXPECT_LE(agreement.free_conflict_fraction, 1.0);
    EXPECT_GE(agreement.overlap_m2, 0.0);
  }
}

TEST(HausdorffTest, AShiftedRoomConflictsWithFreeSpace) {
  const Place from = PlaceIn(FurnishedRoom(), kFirst, 1);
  const Place to = PlaceIn(FurnishedRoom(), kSecond, 2);
  const Pose2 shifted = Inverse(kFirst) * Pose2{1.0, 0.7, 0.0} * kSecond;
  const Agreement agreement = CompareFinishedPlaces(from, to, shifted);
  EXPECT_LT(agreement.hausdorff_fraction, 0.6);
  EXPECT_GT(agreement.free_conflict_fraction, 0.2);
}

TEST(HausdorffTest, PlacesWithoutCommonGroundHaveNothingToSay) {
  const Place place = PlaceIn(FurnishedRoom(), kFirst, 1);
  for (const Agreement& agreement : {CompareFinishedPlaces(place, place, {100.0, 0.0, 0.0}),
                                     CompareFinishedPlaces(place, Place(), {})}) {
    EXPECT_EQ(agreement.hausdorff_fraction, 0.0);
    EXPECT_EQ(agreement.overlap_m2, 0.0);
    EXPECT_EQ(agreement.free_conflict_fraction, 0.0);
  }
}

}  // namespace
}  // namespace loci
