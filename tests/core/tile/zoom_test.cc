// SPDX-License-Identifier: Apache-2.0
#include "core/tile/zoom.h"

#include <gtest/gtest.h>

namespace loci {
namespace {

TEST(ZoomTest, ZoomEightShowsFiveCentimetresPerPixel) {
  EXPECT_DOUBLE_EQ(TileSideM(0), 3276.8);
  EXPECT_DOUBLE_EQ(PixelSideM(0), 12.8);
  EXPECT_DOUBLE_EQ(PixelSideM(8), 0.05);
  EXPECT_DOUBLE_EQ(TileSideM(4), 204.8);
}

TEST(ZoomTest, TilesMeetAtTheOriginAndYGrowsUp) {
  const BoxInMap first = BoxOf({8, 0, 0});
  EXPECT_EQ(first.min, Eigen::Vector2d(0.0, 0.0));
  EXPECT_DOUBLE_EQ(first.max.y(), 12.8);
  const BoxInMap below = BoxOf({8, -1, -1});
  EXPECT_DOUBLE_EQ(below.min.x(), -12.8);
  EXPECT_EQ(below.max, Eigen::Vector2d(0.0, 0.0));
}

TEST(ZoomTest, ATileIsTiledByTheFourOfTheNextZoom) {
  const BoxInMap parent = BoxOf({5, -3, 7});
  EXPECT_EQ(parent.min, BoxOf({6, -6, 14}).min);
  EXPECT_EQ(parent.max, BoxOf({6, -5, 15}).max);
}

TEST(ZoomTest, AddressesOutOfRangeAreNamed) {
  EXPECT_TRUE(Validate({24, (1 << 24) - 1, 1 - (1 << 24)}).ok());
  EXPECT_EQ(Validate({25, 0, 0}).message(), "z: 25, must be from 0 to 24");
  EXPECT_EQ(Validate({-1, 0, 0}).code(), StatusCode::kOutOfRange);
  EXPECT_EQ(Validate({3, 1 << 24, 0}).message(),
            "x: 16777216, must be between -16777216 and 16777216, both excluded");
  EXPECT_EQ(Validate({3, 0, -(1 << 24)}).code(), StatusCode::kOutOfRange);
}

TEST(ZoomTest, TilesUnderABoxAreThoseThatMeetIt) {
  BoxInMap box;
  EXPECT_TRUE(box.Empty());
  EXPECT_TRUE(TilesUnder(box, 8).empty());
  box.Extend({-1.0, 1.0});
  EXPECT_EQ(TilesUnder(box, 8), (std::vector<TileAddress>{{8, -1, 0}}));
  box.Extend({14.0, 13.0});
  EXPECT_EQ(TilesUnder(box, 8),
            (std::vector<TileAddress>{
                {8, -1, 0}, {8, 0, 0}, {8, 1, 0}, {8, -1, 1}, {8, 0, 1}, {8, 1, 1}}));
}

TEST(BoxTest, ExtendsIntersectsAndContains) {
  BoxInMap box;
  box.Extend({1.0, 2.0});
  box.Extend({3.0, 0.0});
  BoxInMap inner;
  inner.Extend({2.0, 1.0});
  EXPECT_TRUE(box.Contains(inner));
  EXPECT_FALSE(inner.Contains(box));
  EXPECT_TRUE(box.Intersects(inner));
  BoxInMap apart;
  apart.Extend({9.0, 1.0});
  EXPECT_FALSE(box.Intersects(apart));
  EXPECT_FALSE(box.Intersects(BoxInMap()));
  box.Extend(BoxInMap());
  EXPECT_EQ(box.max, Eigen::Vector2d(3.0, 2.0));
}

}  // namespace
}  // namespace loci
