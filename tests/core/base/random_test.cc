// SPDX-License-Identifier: Apache-2.0
#include "core/base/random.h"

#include <cmath>

#include <gtest/gtest.h>

namespace loci {
namespace {

constexpr int kCount = 100000;

TEST(RandomTest, TheSameSeedGivesTheSameSequence) {
  RandomSequence a(5);
  RandomSequence b(5);
  RandomSequence other(6);
  int equal = 0;
  for (int i = 0; i < 1000; ++i) {
    const std::uint64_t bits = a.NextBits();
    EXPECT_EQ(bits, b.NextBits());
    equal += bits == other.NextBits() ? 1 : 0;
  }
  EXPECT_EQ(equal, 0);
}

TEST(RandomTest, MixBitsIsSteeleLeaAndFloods) {
  // First outputs of SplitMix64 from the state 0 (the authors' reference implementation).
  EXPECT_EQ(MixBits(0), 0xE220A8397B1DCDAFULL);
  EXPECT_EQ(MixBits(0x9E3779B97F4A7C15ULL), 0x6E789E6AA1B965F4ULL);
}

TEST(RandomTest, UniformNumbersFillTheirInterval) {
  RandomSequence random(1);
  double sum = 0.0;
  double low = 1e9;
  double high = -1e9;
  for (int i = 0; i < kCount; ++i) {
    const double value = random.NextUniform(-2.0, 3.0);
    sum += value;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  EXPECT_GE(low, -2.0);
  EXPECT_LT(high, 3.0);
  EXPECT_LT(low, -1.99);
  EXPECT_GT(high, 2.99);
  EXPECT_NEAR(sum / kCount, 0.5, 5.0 * 5.0 / std::sqrt(12.0 * kCount));
}

TEST(RandomTest, NormalNumbersHaveTheMomentsOfTheNormalDistribution) {
  RandomSequence random(2);
  double sum = 0.0;
  double squares = 0.0;
  double fourth = 0.0;
  for (int i = 0; i < kCount; ++i) {
    const double value = random.NextNormal();
    ASSERT_TRUE(std::isfinite(value));
    sum += value;
    squares += value * value;
    fourth += value * value * value * value;
  }
  EXPECT_NEAR(sum / kCount, 0.0, 0.02);
  EXPECT_NEAR(squares / kCount, 1.0, 0.03);
  EXPECT_NEAR(fourth / kCount, 3.0, 0.2);
}

}  // namespace
}  // namespace loci
