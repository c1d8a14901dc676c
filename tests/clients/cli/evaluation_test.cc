// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/evaluation.h"

#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cli/text_output.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

std::vector<StampedPose2> Circle() {
  std::vector<StampedPose2> poses;
  for (int i = 0; i < 100; ++i) {
    poses.push_back({i * kSecond, {3.0 * Cos(0.1 * i), 3.0 * Sin(0.1 * i), WrapAngle(0.1 * i)}});
  }
  return poses;
}

TEST(CompareTrajectoriesTest, FindsTheRigidMotionBetweenTwoOfOneShape) {
  const std::vector<StampedPose2> truth = Circle();
  const Pose2 estimate_from_truth = {1.0, -2.0, 0.7};
  std::vector<StampedPose2> estimate = truth;
  for (StampedPose2& pose : estimate) {
    pose.pose = estimate_from_truth * pose.pose;
  }
  const auto errors = CompareTrajectories(estimate, truth, kSecond);
  ASSERT_THAT(errors, IsOk());
  EXPECT_EQ(errors->pair_count, truth.size());
  EXPECT_GT(errors->translation_m.rms, 1.0);
  EXPECT_NEAR(errors->rotation_rad.mean, 0.7, 1e-9);
  EXPECT_NEAR(errors->aligned_translation_m.max, 0.0, 1e-9);
  EXPECT_NEAR(errors->aligned_rotation_rad.max, 0.0, 1e-9);
  EXPECT_NEAR(errors->truth_from_estimate.theta, -0.7, 1e-9);
}

TEST(CompareTrajectoriesTest, MeasuresKnownErrors) {
  std::vector<StampedPose2> estimate = Circle();
  estimate[3].pose.x += 0.3;
  estimate[3].pose.y += 0.4;
  const auto errors = CompareTrajectories(estimate, Circle(), kSecond);
  ASSERT_THAT(errors, IsOk());
  EXPECT_NEAR(errors->translation_m.max, 0.5, 1e-12);
  EXPECT_NEAR(errors->translation_m.mean, 0.005, 1e-12);
  EXPECT_NEAR(errors->translation_m.rms, 0.05, 1e-12);
}

TEST(CompareTrajectoriesTest, InterpolatesTheTruthAndLeavesGapsOut) {
  const std::vector<StampedPose2> truth = {
      {0, {0.0, 0.0, 0.0}}, {kSecond, {1.0, 0.0, 0.0}}, {9 * kSecond, {9.0, 0.0, 0.0}}};
  const std::vector<StampedPose2> estimate = {{kSecond / 4, {0.25, 0.0, 0.0}},
                                              {kSecond / 2, {0.5, 0.0, 0.0}},
                                              {5 * kSecond, {77.0, 0.0, 0.0}},
                                              {10 * kSecond, {77.0, 0.0, 0.0}}};
  const auto errors = CompareTrajectories(estimate, truth, kSecond);
  ASSERT_THAT(errors, IsOk());
  EXPECT_EQ(errors->pair_count, 2U);
  EXPECT_EQ(errors->unmatched_count, 2U);
  EXPECT_NEAR(errors->translation_m.max, 0.0, 1e-12);
  EXPECT_THAT(CompareTrajectories({}, truth, kSecond), IsStatus(StatusCode::kInvalidArgument));
}

TEST(ReadTumFileTest, ReadsWhatWeWriteAndNamesABadLine) {
  const TemporaryDirectory folder;
  const std::string path = (folder.path() / "t.tum").string();
  const Pose2 pose = {12.5, -0.001, -3.1};
  std::ofstream(path) << "# stamp x y z qx qy qz qw\n\n"
                      << cli::TumLine(976052857337530123, pose) << '\n';
  const auto poses = ReadTumFile(path);
  ASSERT_THAT(poses, IsOk());
  ASSERT_EQ(poses->size(), 1U);
  EXPECT_EQ(poses->front().stamp_ns, 976052857337530123);
  EXPECT_NEAR(poses->front().pose.x, 12.5, 1e-9);
  EXPECT_NEAR(poses->front().pose.theta, -3.1, 1e-9);
  for (const char* line : {"1 2 3", "x 0 0 0 0 0 0 1", "1 nan 0 0 0 0 0 1", "1 0 0 0 0 0 0 1x"}) {
    std::ofstream(path) << "# one\n" << line << '\n';
    EXPECT_THAT(ReadTumFile(path), IsStatus(StatusCode::kInvalidArgument, ":2:")) << line;
  }
  EXPECT_THAT(ReadTumFile("/nowhere"), IsStatus(StatusCode::kNotFound, "/nowhere"));
}

// A box of walls, free inside, unknown outside.
OccupancyMap Box(std::int32_t side, double x_min_m) {
  OccupancyMap map;
  map.x_min_m = x_min_m;
  map.width = side;
  map.height = side;
  map.cells.assign(static_cast<std::size_t>(side) * static_cast<std::size_t>(side),
                   OccupancyMap::Cell::kUnknown);
  for (std::int32_t row = 3; row < side - 3; ++row) {
    for (std::int32_t column = 3; column < side - 3; ++column) {
      const bool wall = row == 3 || column == 3 || row == side - 4 || column == side - 4;
      map.at(column, row) = wall ? OccupancyMap::Cell::kOccupied : OccupancyMap::Cell::kFree;
    }
  }
  return map;
}

TEST(CompareGridsTest, IsOneForTheSameGridWhereverItsCornerLies) {
  const auto same = CompareGrids(Box(40, 0.0), Box(40, 0.0));
  ASSERT_THAT(same, IsOk());
  EXPECT_EQ(same->iou, 1.0);
  EXPECT_EQ(same->precision, 1.0);
  EXPECT_EQ(same->recall, 1.0);
  OccupancyMap shifted = Box(40, 0.0);  // the same cells in a larger picture
  OccupancyMap larger;
  larger.x_min_m = -0.1;
  larger.y_min_m = -0.15;
  larger.width = 45;
  larger.height = 45;
  larger.cells.assign(45U * 45U, OccupancyMap::Cell::kUnknown);
  for (std::int32_t row = 0; row < 40; ++row) {
    for (std::int32_t column = 0; column < 40; ++column) {
      larger.at(column + 2, row + 3) = shifted.at(column, row);
    }
  }
  EXPECT_EQ(CompareGrids(larger, shifted)->iou, 1.0);
  EXPECT_EQ(CompareGrids(shifted, larger)->iou, 1.0);
}

TEST(CompareGridsTest, FallsWithTheShiftAndKnowsWhatWasNotObserved) {
  const double near = CompareGrids(Box(40, 0.05), Box(40, 0.0))->iou;
  const double far = CompareGrids(Box(40, 0.3), Box(40, 0.0))->iou;
  EXPECT_GT(near, 0.6);
  EXPECT_LT(near, 1.0);
  EXPECT_LT(far, near);
  OccupancyMap half = Box(40, 0.0);  // nobody was in the upper half
  for (std::int32_t row = 20; row < 40; ++row) {
    for (std::int32_t column = 0; column < 40; ++column) {
      half.at(column, row) = OccupancyMap::Cell::kUnknown;
    }
  }
  const auto agreement = CompareGrids(half, Box(40, 0.0));
  EXPECT_GT(agreement->iou, 0.95);
  EXPECT_LT(agreement->iou_everywhere, 0.6);
}

TEST(CompareGridsTest, RefusesGridsThatCannotBeCompared) {
  OccupancyMap coarse = Box(40, 0.0);
  coarse.resolution_m = 0.1;
  EXPECT_THAT(CompareGrids(coarse, Box(40, 0.0)),
              IsStatus(StatusCode::kInvalidArgument, "resolution"));
  OccupancyMap empty = Box(40, 0.0);
  std::fill(empty.cells.begin(), empty.cells.end(), OccupancyMap::Cell::kUnknown);
  EXPECT_THAT(CompareGrids(empty, Box(40, 0.0)), IsStatus(StatusCode::kInvalidArgument));
  EXPECT_THAT(CompareGrids(Box(40, 1e7), Box(40, 0.0)), IsStatus(StatusCode::kInvalidArgument));
}

}  // namespace
}  // namespace loci
