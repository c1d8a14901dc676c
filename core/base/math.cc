// SPDX-License-Identifier: Apache-2.0
#include "core/base/math.h"

#include <cmath>

namespace loci {

double Sin(double angle_rad) {
  return std::sin(angle_rad);
}
double Cos(double angle_rad) {
  return std::cos(angle_rad);
}
double Atan2(double y, double x) {
  return std::atan2(y, x);
}
double Exp(double x) {
  return std::exp(x);
}
double Log(double x) {
  return std::log(x);
}

}  // namespace loci
