// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/ray_caster.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci::simulator {
namespace {

using Eigen::Vector2d;

TEST(RayCasterTest, HitsASegmentWhereItCrossesTheBeam) {
  const Segment wall = {{2.0, -1.0}, {4.0, 1.0}};
  EXPECT_NEAR(DistanceTo(wall, {0.0, 0.0}, {1.0, 0.0}), 3.0, 1e-12);
  EXPECT_TRUE(std::isinf(DistanceTo(wall, {0.0, 0.0}, {-1.0, 0.0})));
  EXPECT_TRUE(std::isinf(DistanceTo(wall, {0.0, 2.0}, {1.0, 0.0})));
  const Vector2d parallel = Vector2d(1.0, 1.0).normalized();
  EXPECT_TRUE(std::isinf(DistanceTo(wall, {0.0, 0.0}, parallel)));
}

TEST(RayCasterTest, HitsADiskOnTheNearSideOnly) {
  const Disk disk = {{5.0, 0.0}, 1.0};
  EXPECT_NEAR(DistanceTo(disk, {0.0, 0.0}, {1.0, 0.0}), 4.0, 1e-12);
  EXPECT_NEAR(DistanceTo(disk, {0.0, 0.6}, {1.0, 0.0}), 4.2, 1e-12);
  EXPECT_TRUE(std::isinf(DistanceTo(disk, {0.0, 1.1}, {1.0, 0.0})));
  EXPECT_TRUE(std::isinf(DistanceTo(disk, {10.0, 0.0}, {1.0, 0.0})));
  EXPECT_TRUE(std::isinf(DistanceTo(disk, {5.2, 0.0}, {1.0, 0.0})));  // from inside
}

TEST(RayCasterTest, EqualsTheLoopOverAllSegments) {
  RandomSequence random(5);
  std::vector<Segment> segments;
  for (int i = 0; i < 200; ++i) {
    const Vector2d from(random.NextUniform(-20.0, 20.0), random.NextUniform(-20.0, 20.0));
    const Vector2d step(random.NextUniform(-4.0, 4.0), random.NextUniform(-4.0, 4.0));
    segments.push_back({from, from + step});
  }
  const RayCaster caster(segments);
  for (int i = 0; i < 5000; ++i) {
    const Vector2d origin(random.NextUniform(-25.0, 25.0), random.NextUniform(-25.0, 25.0));
    const double angle_rad = random.NextUniform(-kPi, kPi);
    const Vector2d direction(Cos(angle_rad), Sin(angle_rad));
    double nearest_m = 30.0;
    for (const Segment& segment : segments) {
      nearest_m = std::min(nearest_m, DistanceTo(segment, origin, direction));
    }
    ASSERT_EQ(caster.Cast(origin, direction, 30.0, {}), nearest_m) << i;
  }
}

}  // namespace
}  // namespace loci::simulator
