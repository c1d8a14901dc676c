// SPDX-License-Identifier: Apache-2.0
// The elementary functions that core may call: the same bits on every processor.
//
// The C library's results differ in the last bit between processors with and without fused
// multiply-add (glibc picks an implementation when it starts), and between libraries. A map that
// closes loops magnifies that to other closures. These functions need nothing but what IEEE 754
// rounds exactly. Their errors are below 1 unit in the last place, Atan2's below 1.5.
#pragma once

namespace loci {

inline constexpr double kPi = 3.14159265358979323846;

// Special values (infinite, NaN, signed zeros) are treated as by the functions of <cmath>, but for
// Sin(-0.0), which is 0.0. Beyond 2^20 rad an angle counts modulo 2 kPi.
double Sin(double angle_rad);
double Cos(double angle_rad);
// Both at once, for less.
struct SineAndCosine {
  double sine = 0.0;
  double cosine = 1.0;
};
SineAndCosine SinCos(double angle_rad);
double Atan2(double y, double x);
double Exp(double x);
double Log(double x);

}  // namespace loci
