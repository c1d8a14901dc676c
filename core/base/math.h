// SPDX-License-Identifier: Apache-2.0
// The elementary functions that core may call.
//
// glibc's results differ in the last bit between processors with and without FMA. All of core goes
// through this file, so that one place answers for it (design.md, section 3).
#pragma once

namespace loci {

inline constexpr double kPi = 3.14159265358979323846;

double Sin(double angle_rad);
double Cos(double angle_rad);
double Atan2(double y, double x);
double Exp(double x);
double Log(double x);

}  // namespace loci
