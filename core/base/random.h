// SPDX-License-Identifier: Apache-2.0
// Random numbers that depend on a seed only: the same on every machine and standard library.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/base/math.h"

namespace loci {

// One step of SplitMix64 (Steele, Lea, Flood 2014): a bijection that spreads bits well.
constexpr std::uint64_t MixBits(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31U);
}

// A sequence of random numbers from a seed.
class RandomSequence {
 public:
  explicit RandomSequence(std::uint64_t seed) : state_(MixBits(seed)) {}

  std::uint64_t NextBits() {
    state_ += 0x9E3779B97F4A7C15ULL;
    return MixBits(state_);
  }

  // Uniform in [0, 1), with 53 random bits.
  double NextUnit() { return static_cast<double>(NextBits() >> 11U) * 0x1.0p-53; }

  double NextUniform(double low, double high) { return low + (high - low) * NextUnit(); }

  // Standard normal, by the sum-free half of Box and Muller's transform.
  double NextNormal() {
    const double radius = std::sqrt(-2.0 * Log(1.0 - NextUnit()));
    return radius * Cos(2.0 * kPi * NextUnit());
  }

 private:
  std::uint64_t state_;
};

}  // namespace loci
