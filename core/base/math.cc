// SPDX-License-Identifier: Apache-2.0
// Each function reduces its argument to where a Taylor series ends below half a unit in the last
// place, and sums that from its smallest term on. Only the operations that IEEE 754 rounds exactly
// are used, in a written order, without fused multiply-add (-ffp-contract=off).
#include "core/base/math.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace loci {
namespace {

// pi / 2 and ln 2 in parts, of which the first have so few bits that their products with whole
// numbers of up to 20 (pi / 2) and 11 (ln 2) bits are exact (Cody and Waite 1980).
constexpr double kHalfPiHigh = 0x1.921FB544p+0;
constexpr double kHalfPiMiddle = 0x1.0B4611A6p-34;
constexpr double kHalfPiLow = 0x1.3198A2E037073p-69;
constexpr double kLn2High = 0x1.62E42FEFp-1;
constexpr double kLn2Low = 0x1.473DE6AF278EDp-34;
constexpr double kLn2 = kLn2High + kLn2Low;
// What kPi lacks of pi.
constexpr double kPiCorrection = 0x1.1A62633145C07p-53;
constexpr double kHalfRoot2 = 0x1.6A09E667F3BCDp-1;

// c[0] + x (c[1] + x (c[2] + ...)).
template <std::size_t kSize>
double Polynomial(const std::array<double, kSize>& c, double x) {
  double sum = c[kSize - 1];
  for (std::size_t i = kSize - 1; i > 0; --i) {
    sum = c[i - 1] + x * sum;
  }
  return sum;
}

// A sum of two doubles, the second a correction of the first.
struct Split {
  double high = 0.0;
  double low = 0.0;
};

// The exact sum of a and b (Knuth 1969).
Split TwoSum(double a, double b) {
  const double sum = a + b;
  const double part = sum - a;
  return {sum, (a - (sum - part)) + (b - part)};
}

// sin(x + low) for |x| <= pi / 4 and a tiny `low`.
double SineOf(const Split& x) {
  constexpr std::array<double, 8> kSeries = {-1.0 / 6.0,
                                             1.0 / 120.0,
                                             -1.0 / 5040.0,
                                             1.0 / 362880.0,
                                             -1.0 / 39916800.0,
                                             1.0 / 6227020800.0,
                                             -1.0 / 1307674368000.0,
                                             1.0 / 355687428096000.0};
  const double z = x.high * x.high;
  const double tail = x.high * (z * Polynomial(kSeries, z));
  return x.high + (tail + x.low * (1.0 - 0.5 * z));
}

// cos(x + low), likewise.
double CosineOf(const Split& x) {
  constexpr std::array<double, 8> kSeries = {1.0 / 24.0,
                                             -1.0 / 720.0,
                                             1.0 / 40320.0,
                                             -1.0 / 3628800.0,
                                             1.0 / 479001600.0,
                                             -1.0 / 87178291200.0,
                                             1.0 / 20922789888000.0,
                                             -1.0 / 6402373705728000.0};
  const double z = x.high * x.high;
  const double half = 0.5 * z;
  const double one_less = 1.0 - half;
  // What rounding took from 1 - z / 2 is added where it is small enough to be kept.
  const double lost = (1.0 - one_less) - half;
  return one_less + (lost + (z * z * Polynomial(kSeries, z) - x.high * x.low));
}

// An angle as `quarters` right angles and a rest of at most pi / 4.
struct Reduced {
  Split rest;
  std::int64_t quarters = 0;
};

Reduced Reduce(double angle_rad) {
  // Further away the parts of pi / 2 have no bits to say where an angle is: it is taken modulo the
  // double next to 2 pi.
  constexpr double kReachRad = 0x1p+20;
  if (!(std::abs(angle_rad) <= kReachRad)) {
    angle_rad = std::fmod(angle_rad, 2.0 * kPi);  // exact; NaN for what is not finite
  }
  if (std::abs(angle_rad) <= 0.25 * kPi) {
    return {{angle_rad, 0.0}, 0};
  }
  const double quarters = std::floor(angle_rad * (2.0 / kPi) + 0.5);
  if (std::isnan(quarters)) {
    return {{angle_rad, 0.0}, 0};
  }
  const double first = angle_rad - quarters * kHalfPiHigh;  // exact
  const Split second = TwoSum(first, -quarters * kHalfPiMiddle);
  const Split rest = TwoSum(second.high, second.low - quarters * kHalfPiLow);
  return {rest, static_cast<std::int64_t>(quarters)};
}

// atan(k / 8).
constexpr std::array<Split, 9> kAtanOfEighths = {{
    {0.0, 0.0},
    {0x1.FD5BA9AAC2F6Ep-4, -0x1.CD37686760C17p-59},
    {0x1.F5B75F92C80DDp-3, 0x1.8AB6E3CF7AFBDp-57},
    {0x1.6F61941E4DEF1p-2, -0x1.C63AAE6F6E918p-56},
    {0x1.DAC670561BB4Fp-2, 0x1.A2B7F222F65E2p-56},
    {0x1.1E00BABDEFEB4p-1, -0x1.928DF287A668Fp-58},
    {0x1.4978FA3269EE1p-1, 0x1.2419A87F2A458p-56},
    {0x1.700A7C5784634p-1, -0x1.8C34D25AADEF6p-56},
    {0x1.921FB54442D18p-1, 0x1.1A62633145C07p-55},
}};

// atan(y / x) for 0 <= y <= x, x > 0.
Split AtanOfRatio(double y, double x) {
  constexpr std::array<double, 7> kSeries = {
      -1.0 / 3.0, 1.0 / 5.0, -1.0 / 7.0, 1.0 / 9.0, -1.0 / 11.0, 1.0 / 13.0, -1.0 / 15.0};
  const double eighths = std::floor(8.0 * (y / x) + 0.5);
  const double c = 0.125 * eighths;
  // atan(y / x) = atan(c) + atan(t), t = (y - c x) / (x + c y).
  const double t = (y - c * x) / (x + c * y);
  const double z = t * t;
  const Split& table = kAtanOfEighths[static_cast<std::size_t>(eighths)];
  return {table.high, t + (t * (z * Polynomial(kSeries, z)) + table.low)};
}

// A direction in the first quadrant; its length is of no account.
struct Direction {
  double y = 0.0;
  double x = 0.0;
};

// The same direction with a length that neither overflows nor underflows in what follows.
Direction DirectionOf(double y, double x) {
  if (std::isinf(x) || std::isinf(y)) {
    return {std::isinf(y) ? 1.0 : 0.0, std::isinf(x) ? 1.0 : 0.0};
  }
  const double larger = std::max(x, y);
  const double scale = larger > 0x1p+1000 ? 0x1p-100 : larger < 0x1p-900 ? 0x1p+100 : 1.0;
  return {y * scale, x * scale};
}

}  // namespace

double Sin(double angle_rad) {
  const Reduced reduced = Reduce(angle_rad);
  switch (reduced.quarters & 3) {
    case 0:
      return SineOf(reduced.rest);
    case 1:
      return CosineOf(reduced.rest);
    case 2:
      return -SineOf(reduced.rest);
    default:
      return -CosineOf(reduced.rest);
  }
}

double Cos(double angle_rad) {
  const Reduced reduced = Reduce(angle_rad);
  switch (reduced.quarters & 3) {
    case 0:
      return CosineOf(reduced.rest);
    case 1:
      return -SineOf(reduced.rest);
    case 2:
      return -CosineOf(reduced.rest);
    default:
      return SineOf(reduced.rest);
  }
}

SineAndCosine SinCos(double angle_rad) {
  const Reduced reduced = Reduce(angle_rad);
  const double sine = SineOf(reduced.rest);
  const double cosine = CosineOf(reduced.rest);
  switch (reduced.quarters & 3) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

double Atan2(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) {
    return x + y;
  }
  const Direction direction = DirectionOf(std::abs(y), std::abs(x));
  const bool steep = direction.y > direction.x;
  const bool backwards = std::signbit(x);
  Split angle;
  if (direction.x > 0.0 || direction.y > 0.0) {
    angle = steep ? AtanOfRatio(direction.x, direction.y) : AtanOfRatio(direction.y, direction.x);
  }
  if (steep || backwards) {
    // From the nearest axis that the angle is measured from, forwards or backwards.
    const double sign = steep == backwards ? 1.0 : -1.0;
    const Split from = steep ? Split{0.5 * kPi, 0.5 * kPiCorrection} : Split{kPi, kPiCorrection};
    const Split sum = TwoSum(from.high, sign * angle.high);
    angle = {sum.high, sum.low + (from.low + sign * angle.low)};
  }
  return std::copysign(angle.high + angle.low, y);
}

double Exp(double x) {
  constexpr std::array<double, 12> kSeries = {1.0 / 2.0,
                                              1.0 / 6.0,
                                              1.0 / 24.0,
                                              1.0 / 120.0,
                                              1.0 / 720.0,
                                              1.0 / 5040.0,
                                              1.0 / 40320.0,
                                              1.0 / 362880.0,
                                              1.0 / 3628800.0,
                                              1.0 / 39916800.0,
                                              1.0 / 479001600.0,
                                              1.0 / 6227020800.0};
  if (!(std::abs(x) < 746.0)) {  // beyond, and for NaN, there is nothing to compute
    return x > 0.0 ? std::numeric_limits<double>::infinity() : x < 0.0 ? 0.0 : x;
  }
  const double halvings = std::floor(x * (1.0 / kLn2) + 0.5);
  const Split r = TwoSum(x - halvings * kLn2High, -halvings * kLn2Low);
  const double small = r.high + (r.low + r.high * r.high * Polynomial(kSeries, r.high));
  return std::ldexp(1.0 + small, static_cast<int>(halvings));
}

double Log(double x) {
  // 2 atanh(s) = 2 s + s (2/3 s^2 + 2/5 s^4 + ...).
  constexpr std::array<double, 11> kSeries = {2.0 / 3.0,
                                              2.0 / 5.0,
                                              2.0 / 7.0,
                                              2.0 / 9.0,
                                              2.0 / 11.0,
                                              2.0 / 13.0,
                                              2.0 / 15.0,
                                              2.0 / 17.0,
                                              2.0 / 19.0,
                                              2.0 / 21.0,
                                              2.0 / 23.0};
  if (!(x > 0.0) || std::isinf(x)) {
    return x == 0.0  ? -std::numeric_limits<double>::infinity()
           : x < 0.0 ? std::numeric_limits<double>::quiet_NaN()
                     : x;
  }
  int doublings = 0;
  double mantissa = std::frexp(x, &doublings);  // in [0.5, 1)
  if (mantissa < kHalfRoot2) {
    mantissa *= 2.0;
    --doublings;
  }
  // With s = f / (2 + f), 2 s = f - s f: f is exact, and what is rounded is small beside it.
  const double f = mantissa - 1.0;
  const double s = f / (2.0 + f);
  const double z = s * s;
  const double less = s * (f - z * Polynomial(kSeries, z));
  const double k = doublings;
  return k * kLn2High - ((less - k * kLn2Low) - f);
}

}  // namespace loci
