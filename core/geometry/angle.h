// SPDX-License-Identifier: Apache-2.0
// Angles in radians.
#pragma once

#include <cmath>

#include "core/base/math.h"

namespace loci {

// The same angle in (-pi, pi].
inline double WrapAngle(double angle_rad) {
  if (angle_rad > -kPi && angle_rad <= kPi) {
    return angle_rad;
  }
  double wrapped = std::remainder(angle_rad, 2.0 * kPi);  // exact, in [-pi, pi]
  if (wrapped <= -kPi) {
    wrapped += 2.0 * kPi;
  }
  return wrapped;
}

}  // namespace loci
