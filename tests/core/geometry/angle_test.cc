// SPDX-License-Identifier: Apache-2.0
#include "core/geometry/angle.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

TEST(AngleTest, PiStaysPiAndMinusPiBecomesPi) {
  EXPECT_EQ(WrapAngle(kPi), kPi);
  EXPECT_EQ(WrapAngle(-kPi), kPi);
  EXPECT_EQ(WrapAngle(3.0 * kPi), kPi);
  EXPECT_EQ(WrapAngle(-3.0 * kPi), kPi);
  EXPECT_EQ(WrapAngle(0.0), 0.0);
}

TEST(AngleTest, TheNeighboursOfPiAreWrappedToTheirOwnSide) {
  const double above = std::nextafter(kPi, 4.0);
  EXPECT_LT(WrapAngle(above), 0.0);
  EXPECT_NEAR(WrapAngle(above), -kPi, 1e-15);
  const double inside = std::nextafter(-kPi, 0.0);
  EXPECT_EQ(WrapAngle(inside), inside);
}

TEST(AngleTest, WrappedAnglesLieInTheIntervalAndPointTheSameWay) {
  RandomSequence random(3);
  for (int i = 0; i < 10000; ++i) {
    const double angle = random.NextUniform(-100.0, 100.0);
    const double wrapped = WrapAngle(angle);
    EXPECT_GT(wrapped, -kPi);
    EXPECT_LE(wrapped, kPi);
    EXPECT_NEAR(Cos(wrapped), Cos(angle), 1e-12);
    EXPECT_NEAR(Sin(wrapped), Sin(angle), 1e-12);
    EXPECT_EQ(WrapAngle(wrapped), wrapped);
  }
}

}  // namespace
}  // namespace loci
