// SPDX-License-Identifier: Apache-2.0
// Poses and covariances of the protocol.
#pragma once

#include <array>
#include <cmath>

#include <google/protobuf/repeated_field.h>

#include <Eigen/Core>

#include "core/geometry/angle.h"
#include "core/geometry/se2.h"
#include "loci/v1/mapping.pb.h"

namespace loci {

// Any finite angle is brought to (-pi, pi]; whether the numbers are sensible is checked with the
// event or request that the pose is part of.
inline Pose2 PoseFrom(const v1::Pose2& message) {
  const double theta = message.theta();
  return {message.x(), message.y(), std::isfinite(theta) ? WrapAngle(theta) : theta};
}

inline void Fill(const Pose2& pose, v1::Pose2& message) {
  message.set_x(pose.x);
  message.set_y(pose.y);
  message.set_theta(pose.theta);
}

// Appends the upper triangle, row by row.
inline void FillUpper(const Eigen::Matrix3d& matrix,
                      google::protobuf::RepeatedField<double>& numbers) {
  for (int row = 0; row < 3; ++row) {
    for (int column = row; column < 3; ++column) {
      numbers.Add(matrix(row, column));
    }
  }
}

}  // namespace loci
