// SPDX-License-Identifier: Apache-2.0
// How far a wheeled robot's odometry is trusted when a log does not say.
#pragma once

#include <array>

#include "core/geometry/se2.h"

namespace loci {

// Covariance of one motion previous_from_robot: order (x, y, theta), right perturbation, upper
// triangle row by row. Standard deviations: 10 % of the distance and 5 mm; 10 % of the turn, 0.03
// rad for each metre and 3 mrad. Generous on purpose: it sets how wide a matcher looks.
inline std::array<double, 6> OdometryCovarianceUpper(const Pose2& previous_from_robot) {
  const double distance_m = previous_from_robot.translation().norm();
  const auto square = [](double value) { return value * value; };
  const double translation = square(0.1 * distance_m) + square(0.005);
  const double rotation =
      square(0.1 * previous_from_robot.theta) + square(0.03 * distance_m) + square(0.003);
  return {translation, 0.0, 0.0, translation, 0.0, rotation};
}

}  // namespace loci
