// SPDX-License-Identifier: Apache-2.0
#include "core/matching/correlative_search.h"

#include <gtest/gtest.h>

#include "tests/support/patches.h"

namespace loci {
namespace {

LikelihoodGrid RandomGrid(RandomSequence& random, std::int32_t reach, int cells) {
  LikelihoodGrid grid({{-4, -4}, {4, 4}}, 0.05);
  for (int i = 0; i < cells; ++i) {
    grid.Add({static_cast<std::int32_t>(random.NextUniform(-reach, reach)),
              static_cast<std::int32_t>(random.NextUniform(-reach, reach))});
  }
  return grid;
}

std::vector<Eigen::Vector2d> RandomPoints(RandomSequence& random,
                                          std::size_t count,
                                          double reach_m) {
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < count; ++i) {
    points.emplace_back(random.NextUniform(-reach_m, reach_m),
                        random.NextUniform(-reach_m, reach_m));
  }
  return points;
}

void ExpectSame(const std::vector<Eigen::Vector2d>& points,
                const Pose2& predicted,
                const SearchWindow& window,
                const LikelihoodGrid& grid) {
  const CorrelativeMatch fast = FindBestPose(points, predicted, window, grid);
  const CorrelativeMatch plain = FindBestPosePlainly(points, predicted, window, grid);
  EXPECT_EQ(fast.grid_from_robot, plain.grid_from_robot);
  EXPECT_EQ(fast.score, plain.score);
  EXPECT_EQ(fast.likelihood, plain.likelihood);
  EXPECT_EQ(fast.raw, plain.raw);
}

TEST(CorrelativeSearchTest, EqualsThePlainLoopInRandomScenes) {
  RandomSequence random(1);
  for (int round = 0; round < 300; ++round) {
    SCOPED_TRACE(round);
    const LikelihoodGrid grid = RandomGrid(random, 60, 1 + round % 80);
    const std::vector<Eigen::Vector2d> points =
        RandomPoints(random, random.NextBits() % 40, round % 3 == 0 ? 8.0 : 2.5);
    SearchWindow window;
    window.half_x_m = random.NextUniform(0.0, 0.5);
    window.half_y_m = random.NextUniform(0.0, 0.3);
    window.half_theta_rad = random.NextUniform(0.0, 0.05);
    window.border_penalty = round % 4 == 0 ? 0.0 : random.NextUniform(0.0, 0.1);
    const Pose2 predicted{random.NextUniform(-2.0, 2.0),
                          random.NextUniform(-2.0, 2.0),
                          random.NextUniform(-3.2, 3.2)};
    ExpectSame(points, predicted, window, grid);
  }
}

TEST(CorrelativeSearchTest, EqualsThePlainLoopWithMorePointsThanSixteenBitsHold) {
  RandomSequence random(2);
  // All cells are occupied: every byte is 255, so sums pass 65535 at the 258th point.
  LikelihoodGrid grid({{-60, -60}, {60, 60}}, 0.05);
  for (std::int32_t y = -50; y < 50; ++y) {
    for (std::int32_t x = -50; x < 50; ++x) {
      grid.Add({x, y});
    }
  }
  SearchWindow window;
  window.half_theta_rad = 0.03;
  for (const std::size_t count : {255U, 256U, 257U, 258U, 512U, 700U}) {
    SCOPED_TRACE(count);
    ExpectSame(RandomPoints(random, count, 1.5), {}, window, grid);
  }
  EXPECT_EQ(FindBestPose(RandomPoints(random, 700, 1.0), {}, window, grid).raw, 700U * 255U);
}

TEST(CorrelativeSearchTest, EqualsThePlainLoopInWindowsOfEveryWidth) {
  RandomSequence random(3);
  const LikelihoodGrid grid = RandomGrid(random, 80, 150);
  const std::vector<Eigen::Vector2d> points = RandomPoints(random, 30, 3.0);
  for (int half_steps = 0; half_steps <= 26; ++half_steps) {
    SCOPED_TRACE(half_steps);
    SearchWindow window;
    window.half_x_m = 0.05 * half_steps;
    window.half_y_m = 0.05 * (half_steps % 5);
    window.half_theta_rad = 0.02;
    ExpectSame(points, {0.3, -0.2, 0.4}, window, grid);
  }
}

TEST(CorrelativeSearchTest, EqualsThePlainLoopAroundTheBorderOfTheGrid) {
  RandomSequence random(4);
  const LikelihoodGrid grid = RandomGrid(random, 20, 30);
  for (int round = 0; round < 100; ++round) {
    SCOPED_TRACE(round);
    const Pose2 predicted{random.NextUniform(-9.0, 9.0),
                          random.NextUniform(-9.0, 9.0),
                          random.NextUniform(-3.0, 3.0)};
    SearchWindow window;
    window.half_x_m = 0.8;
    window.half_theta_rad = 0.02;
    ExpectSame(RandomPoints(random, 25, 3.0), predicted, window, grid);
  }
}

TEST(CorrelativeSearchTest, OfEqualPosesTheFirstInOrderIsTaken) {
  const LikelihoodGrid empty({{0, 0}, {1, 1}}, 0.05);
  SearchWindow window;
  window.half_x_m = 0.1;
  window.half_y_m = 0.15;
  window.half_theta_rad = 0.03;
  window.border_penalty = 0.0;
  const std::vector<Eigen::Vector2d> points = {{1.0, 1.0}};
  const CorrelativeMatch match = FindBestPose(points, {}, window, empty);
  EXPECT_NEAR(match.grid_from_robot.x, -0.1, 1e-12);
  EXPECT_NEAR(match.grid_from_robot.y, -0.15, 1e-12);
  EXPECT_NEAR(match.grid_from_robot.theta, -0.028, 1e-12);
  ExpectSame(points, {}, window, empty);
}

TEST(CorrelativeSearchTest, WhereTheSceneDoesNotDecideThePredictionDoes) {
  const LikelihoodGrid empty({{0, 0}, {1, 1}}, 0.05);
  const Pose2 predicted{3.0, 2.0, 1.0};
  const std::vector<Eigen::Vector2d> points = {{1.0, 1.0}, {2.0, 0.0}};
  EXPECT_EQ(FindBestPose(points, predicted, SearchWindow(), empty).grid_from_robot, predicted);
  EXPECT_EQ(FindBestPose({}, predicted, SearchWindow(), empty).grid_from_robot, predicted);
}

TEST(CorrelativeSearchTest, FindsARobotInARoomToTheNearestStep) {
  RandomSequence random(5);
  const Patch patch = PatchOfRoom(random);
  const LikelihoodGrid grid = LikelihoodGrid::OfPatch(patch, 1);
  const SimulatedWorld world = FurnishedRoom();
  SearchWindow window;
  window.half_x_m = window.half_y_m = 0.3;
  for (int round = 0; round < 20; ++round) {
    const Pose2 pose{random.NextUniform(-1.5, 1.0),
                     random.NextUniform(-1.5, 1.0),
                     random.NextUniform(-3.0, 3.0)};
    const Pose2 predicted = pose * Pose2{random.NextUniform(-0.15, 0.15),
                                         random.NextUniform(-0.15, 0.15),
                                         random.NextUniform(-0.1, 0.1)};
    const CorrelativeMatch match =
        FindBestPose(PointsOf(world.Scan(pose, Scanner(), random)), predicted, window, grid);
    const Pose2 error = Inverse(pose) * match.grid_from_robot;
    EXPECT_LT(error.translation().norm(), 0.08) << round;
    EXPECT_LT(std::abs(error.theta), 0.025) << round;
    EXPECT_GT(match.likelihood, 0.7) << round;
  }
}

TEST(CorrelativeSearchTest, TheLikelihoodIsTheCorrelationAtTheResult) {
  RandomSequence random(6);
  const LikelihoodGrid grid = RandomGrid(random, 60, 100);
  const std::vector<Eigen::Vector2d> points = RandomPoints(random, 100, 2.0);
  const Pose2 predicted{0.021, 0.037, 0.3};  // off the lattice: no point sits on a cell's border
  const CorrelativeMatch match = FindBestPose(points, predicted, SearchWindow(), grid);
  EXPECT_NEAR(CorrelationAt(points, match.grid_from_robot, grid), match.likelihood, 1e-12);
}

}  // namespace
}  // namespace loci
