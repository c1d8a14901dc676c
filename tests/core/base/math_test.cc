// SPDX-License-Identifier: Apache-2.0
#include "core/base/math.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "core/base/hash.h"
#include "core/base/random.h"

namespace loci {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kRounds = 100'000;

// How far `value` is from `exact`, in units of the last place of `exact`.
double ErrorInUlps(double value, long double exact) {
  int exponent = 0;
  std::frexp(static_cast<double>(exact), &exponent);
  const long double ulp = std::ldexp(1.0L, std::max(exponent - 53, -1074));
  return static_cast<double>(std::abs(static_cast<long double>(value) - exact) / ulp);
}

// Of either sign, of all magnitudes from 2^-`reach` to 2^`reach`.
double RandomNumber(RandomSequence& random, int reach) {
  const int exponent = static_cast<int>(random.NextUniform(-reach, reach));
  return std::ldexp(random.NextUniform(-2.0, 2.0), exponent);
}

TEST(MathTest, SineAndCosineAreExactToTheLastPlace) {
  RandomSequence random(1);
  double worst = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    const double x = RandomNumber(random, 15);
    const long double exact_x = x;
    worst = std::max(worst, ErrorInUlps(Sin(x), std::sin(exact_x)));
    worst = std::max(worst, ErrorInUlps(Cos(x), std::cos(exact_x)));
    ASSERT_EQ(SinCos(x).sine, Sin(x)) << x;
    ASSERT_EQ(SinCos(x).cosine, Cos(x)) << x;
  }
  EXPECT_LT(worst, 1.0);
}

TEST(MathTest, ArcTangentIsExactToTheLastPlaceButOne) {
  RandomSequence random(2);
  double worst = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    const double y = RandomNumber(random, 12);
    const double x = RandomNumber(random, 12);
    worst = std::max(worst, ErrorInUlps(Atan2(y, x), std::atan2(static_cast<long double>(y), x)));
  }
  EXPECT_LT(worst, 1.5);
}

TEST(MathTest, ExponentialAndLogarithmAreExactToTheLastPlace) {
  RandomSequence random(3);
  double worst = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    const double x = random.NextUniform(-700.0, 700.0);
    worst = std::max(worst, ErrorInUlps(Exp(x), std::exp(static_cast<long double>(x))));
    const double small = RandomNumber(random, 20);
    const long double exact_small = small;
    worst = std::max(worst,
                     ErrorInUlps(Exp(std::clamp(small, -700.0, 700.0)),
                                 std::exp(std::clamp(exact_small, -700.0L, 700.0L))));
    const double positive = std::abs(RandomNumber(random, 1000));
    worst =
        std::max(worst, ErrorInUlps(Log(positive), std::log(static_cast<long double>(positive))));
    const double near_one = random.NextUniform(0.5, 2.0);
    worst =
        std::max(worst, ErrorInUlps(Log(near_one), std::log(static_cast<long double>(near_one))));
  }
  EXPECT_LT(worst, 1.0);
}

TEST(MathTest, RightAnglesAreWhatTheyShouldBe) {
  EXPECT_EQ(Atan2(0.0, -1.0), kPi);
  EXPECT_EQ(Atan2(-0.0, -1.0), -kPi);
  EXPECT_EQ(Atan2(1.0, 0.0), 0.5 * kPi);
  EXPECT_EQ(Atan2(-3.0, 0.0), -0.5 * kPi);
  EXPECT_EQ(Atan2(2.0, 2.0), 0.25 * kPi);
  EXPECT_EQ(Sin(0.0), 0.0);
  EXPECT_EQ(Cos(0.0), 1.0);
  EXPECT_EQ(Sin(0.5 * kPi), 1.0);
  EXPECT_EQ(Cos(kPi), -1.0);
  EXPECT_EQ(Exp(0.0), 1.0);
  EXPECT_EQ(Log(1.0), 0.0);
}

TEST(MathTest, SpecialValuesAreTreatedAsByTheCLibrary) {
  for (const double x : {0.0, -0.0, 1.0, -1.0, kInfinity, -kInfinity, kNan, 1e-320, 1.7e308}) {
    for (const double y : {0.0, -0.0, 1.0, -1.0, kInfinity, -kInfinity, kNan, 1e-320, 1.7e308}) {
      const double expected = std::atan2(y, x);
      const double computed = Atan2(y, x);
      EXPECT_EQ(std::isnan(computed), std::isnan(expected)) << y << " " << x;
      EXPECT_TRUE(std::isnan(expected) ||
                  std::abs(computed - expected) <= 1e-15 * std::abs(expected))
          << y << " " << x << ": " << computed << ", not " << expected;
      EXPECT_TRUE(std::isnan(expected) || std::signbit(computed) == std::signbit(expected));
    }
  }
  for (const double x : {kInfinity, -kInfinity, kNan}) {
    EXPECT_TRUE(std::isnan(Sin(x)));
    EXPECT_TRUE(std::isnan(Cos(x)));
  }
  EXPECT_EQ(Exp(kInfinity), kInfinity);
  EXPECT_EQ(Exp(710.0), kInfinity);
  EXPECT_EQ(Exp(-kInfinity), 0.0);
  EXPECT_EQ(Exp(-746.0), 0.0);
  EXPECT_TRUE(std::isnan(Exp(kNan)));
  EXPECT_EQ(Exp(-745.0), std::numeric_limits<double>::denorm_min());
  EXPECT_EQ(Log(kInfinity), kInfinity);
  EXPECT_EQ(Log(0.0), -kInfinity);
  EXPECT_TRUE(std::isnan(Log(-1.0)));
  EXPECT_TRUE(std::isnan(Log(kNan)));
  EXPECT_NEAR(Log(std::numeric_limits<double>::denorm_min()), -744.4400719213812, 1e-12);
}

TEST(MathTest, AnglesOfAnySizeHaveASineAndACosine) {
  RandomSequence random(4);
  for (int round = 0; round < 1000; ++round) {
    const double x = RandomNumber(random, 1000);
    EXPECT_NEAR(Sin(x) * Sin(x) + Cos(x) * Cos(x), 1.0, 1e-15) << x;
  }
}

// A constant of mathematics and of this file, not of a machine: CI looks for it with and without
// fused multiply-add.
TEST(MathTest, EveryBitIsTheSameOnEveryProcessor) {
  RandomSequence random(5);
  Hasher hasher;
  const auto add = [&hasher](double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof(bits));
    hasher.Add(bits);
  };
  for (int round = 0; round < 20'000; ++round) {
    const double x = RandomNumber(random, 15);
    const double y = RandomNumber(random, 15);
    add(Sin(x));
    add(Cos(x));
    add(Atan2(y, x));
    add(Exp(random.NextUniform(-700.0, 700.0)));
    add(Log(std::abs(x)));
  }
  EXPECT_EQ(hasher.Finish().ToHex(), "516a978cd81d2d95d12ef05d8c7e2f5d");
}

}  // namespace
}  // namespace loci
