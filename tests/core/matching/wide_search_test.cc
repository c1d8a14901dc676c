// SPDX-License-Identifier: Apache-2.0
#include "core/matching/wide_search.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/patches.h"

namespace loci {
namespace {

struct PlainResult {
  bool found = false;
  double score = 0.0;
  Pose2 pose;
};

// The same steps, one after the other.
PlainResult FindPlainly(const LikelihoodGrid& grid,
                        const std::vector<Eigen::Vector2d>& points,
                        const Pose2& predicted,
                        const SearchWindow& window,
                        double score_min,
                        const ExcludedPoses* excluded) {
  const auto steps = [](double half, double step) {
    return static_cast<int>(std::floor(half / step + 1e-9));
  };
  const int nx = steps(window.half_x_m, grid.cell_size_m());
  const int ny = steps(window.half_y_m, grid.cell_size_m());
  const int nt = steps(window.half_theta_rad, window.step_theta_rad);
  const auto part = [](int i, int n) { return n == 0 ? 0.0 : std::pow(double(i) / n, 2.0); };
  PlainResult best;
  best.score = score_min;
  for (int t = -nt; t <= nt; ++t) {
    const Pose2 turned{
        predicted.x, predicted.y, WrapAngle(predicted.theta + t * window.step_theta_rad)};
    for (int y = -ny; y <= ny; ++y) {
      for (int x = -nx; x <= nx; ++x) {
        const Pose2 pose{predicted.x + x * grid.cell_size_m(),
                         predicted.y + y * grid.cell_size_m(),
                         turned.theta};
        if (excluded != nullptr) {
          const Eigen::Vector3d difference(pose.x - excluded->center.x,
                                           pose.y - excluded->center.y,
                                           WrapAngle(pose.theta - excluded->center.theta));
          if (difference.dot(excluded->information * difference) <= 1.0) {
            continue;
          }
        }
        double sum = 0.0;
        for (const Eigen::Vector2d& point : points) {
          const Eigen::Vector2d moved = (turned * point) / grid.cell_size_m();
          sum += grid.At({static_cast<std::int32_t>(std::floor(moved.x())) + x,
                          static_cast<std::int32_t>(std::floor(moved.y())) + y});
        }
        const double score = sum / (255.0 * static_cast<double>(points.size())) -
                             window.border_penalty * (part(x, nx) + part(y, ny) + part(t, nt));
        if (score > best.score) {
          best = {true, score, pose};
        }
      }
    }
  }
  return best;
}

std::vector<Eigen::Vector2d> RandomPoints(RandomSequence& random, int count, double reach_m) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < count; ++i) {
    points.emplace_back(random.NextUniform(-reach_m, reach_m),
                        random.NextUniform(-reach_m, reach_m));
  }
  return points;
}

void ExpectSame(RandomSequence& random, bool exclude) {
  LikelihoodGrid grid({{-4, -4}, {4, 4}}, 0.05);
  for (int i = 0; i < 60; ++i) {
    grid.Add({static_cast<std::int32_t>(random.NextUniform(-70, 70)),
              static_cast<std::int32_t>(random.NextUniform(-70, 70))});
  }
  const std::vector<Eigen::Vector2d> points = RandomPoints(random, 20, 2.5);
  SearchWindow window;
  window.half_x_m = random.NextUniform(0.0, 1.6);
  window.half_y_m = random.NextUniform(0.0, 1.2);
  window.half_theta_rad = 0.06;
  window.border_penalty = random.NextUniform(0.0, 0.1);
  const Pose2 predicted{
      random.NextUniform(-2.0, 2.0), random.NextUniform(-2.0, 2.0), random.NextUniform(-3.2, 3.2)};
  const double score_min = random.NextUniform(-0.1, 0.15);
  const WideSearch search(grid);
  ExcludedPoses excluded;
  if (exclude) {  // what would be the best
    excluded.center = FindPlainly(grid, points, predicted, window, -1.0, nullptr).pose;
    excluded.information = Eigen::Vector3d(30.0, 20.0, 900.0).asDiagonal();
  }
  const ExcludedPoses* region = exclude ? &excluded : nullptr;
  const std::optional<CorrelativeMatch> found =
      search.FindBest(points, predicted, window, score_min, region);
  const PlainResult plain = FindPlainly(grid, points, predicted, window, score_min, region);
  ASSERT_EQ(found.has_value(), plain.found);
  if (found.has_value()) {
    EXPECT_NEAR(found->score, plain.score, 1e-12);
    if (found->grid_from_robot != plain.pose) {  // of equals another one: as good as the best
      const PlainResult at_found = FindPlainly(
          grid, points, found->grid_from_robot, {0.0, 0.0, 0.0, 0.014, 0.0}, -1.0, region);
      EXPECT_NEAR(at_found.score, found->likelihood, 1e-12);
    }
  }
}

TEST(WideSearchTest, EqualsThePlainLoopOverAllSteps) {
  RandomSequence random(1);
  for (int round = 0; round < 60; ++round) {
    SCOPED_TRACE(round);
    ExpectSame(random, false);
  }
}

TEST(WideSearchTest, EqualsThePlainLoopWhereARegionIsExcluded) {
  RandomSequence random(2);
  for (int round = 0; round < 60; ++round) {
    SCOPED_TRACE(round);
    ExpectSame(random, true);
  }
}

TEST(WideSearchTest, FindsARoomFromFarAway) {
  RandomSequence random(3);
  const Patch patch = PatchOfRoom(random);
  const WideSearch search(LikelihoodGrid::OfPatch(patch, 1));
  const Pose2 pose{0.5, -0.3, 0.2};
  const std::vector<Eigen::Vector2d> points =
      PointsOf(FurnishedRoom().Scan(pose, FullTurnScanner(120), random));
  SearchWindow window;
  window.half_x_m = window.half_y_m = 6.0;
  window.half_theta_rad = 0.7;
  const std::optional<CorrelativeMatch> found =
      search.FindBest(points, pose * Pose2{3.5, -2.0, 0.4}, window, 0.3, nullptr);
  ASSERT_TRUE(found.has_value());
  const Pose2 error = Inverse(pose) * found->grid_from_robot;
  EXPECT_LT(error.translation().norm(), 0.1);
  EXPECT_LT(std::abs(error.theta), 0.03);
}

TEST(WideSearchTest, NothingAboveTheThresholdIsNothing) {
  LikelihoodGrid grid({{-4, -4}, {4, 4}}, 0.05);
  grid.Add({0, 0});
  const std::vector<Eigen::Vector2d> points = {{0.0, 0.0}, {30.0, 30.0}};
  SearchWindow window;
  window.border_penalty = 0.0;
  EXPECT_TRUE(WideSearch(grid).FindBest(points, {}, window, 0.49, nullptr).has_value());
  EXPECT_FALSE(WideSearch(grid).FindBest(points, {}, window, 0.51, nullptr).has_value());
}

}  // namespace
}  // namespace loci
