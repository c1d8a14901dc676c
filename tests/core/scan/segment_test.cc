// SPDX-License-Identifier: Apache-2.0
#include "core/scan/segment.h"

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

std::vector<ScanPoint> AlongX(std::initializer_list<double> xs) {
  std::vector<ScanPoint> points;
  for (const double x : xs) {
    points.push_back({{x, 0.0}, static_cast<std::uint32_t>(points.size())});
  }
  return points;
}

TEST(SegmentTest, NoPointsMakeNoSegment) {
  EXPECT_TRUE(SegmentByDistance({}, 0.3).empty());
}

TEST(SegmentTest, AGapOfExactlyTheLimitJoins) {
  EXPECT_EQ(SegmentByDistance(AlongX({0.0, 0.25, 0.5}), 0.25).size(), 1U);
  EXPECT_EQ(SegmentByDistance(AlongX({0.0, 0.25, 0.51}), 0.25).size(), 2U);
}

TEST(SegmentTest, SegmentsCoverAllPointsInOrderAndBreakAtGapsOnly) {
  RandomSequence random(1);
  std::vector<ScanPoint> points;
  double x = 0.0;
  for (std::uint32_t i = 0; i < 500; ++i) {
    x += random.NextUniform(0.0, 0.5);
    points.push_back({{x, random.NextUniform(0.0, 0.1)}, i});
  }
  const std::vector<Segment> segments = SegmentByDistance(points, kSegmentGapM);
  EXPECT_GT(segments.size(), 50U);
  std::size_t next = 0;
  for (const Segment& segment : segments) {
    ASSERT_EQ(segment.begin, next);
    ASSERT_LT(segment.begin, segment.end);
    next = segment.end;
    for (std::size_t i = segment.begin; i < segment.end; ++i) {
      const bool begins = i == segment.begin;
      if (i > 0) {
        const double gap_m = (points[i].point_in_robot - points[i - 1].point_in_robot).norm();
        EXPECT_EQ(begins, gap_m > kSegmentGapM) << i;
      }
    }
  }
  EXPECT_EQ(next, points.size());
}

}  // namespace
}  // namespace loci
