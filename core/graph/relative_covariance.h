// SPDX-License-Identifier: Apache-2.0
// How well the pose of one node relative to another is known, from how well the two are.
#pragma once

#include <Eigen/Core>

#include "core/geometry/se2.h"

namespace loci {

// Covariance of from_from_to * Exp(xi), (x, y, theta), from those of the two nodes' poses in the
// map, right perturbation: xi = xi_to - Adjoint(to_from_from) * xi_from, to first order.
// `from_to` is the block of from's rows and to's columns.
inline Eigen::Matrix3d RelativeCovarianceOf(const Pose2& to_from_from,
                                            const Eigen::Matrix3d& from_from,
                                            const Eigen::Matrix3d& from_to,
                                            const Eigen::Matrix3d& to_to) {
  const Eigen::Matrix3d adjoint = Adjoint(to_from_from);
  const Eigen::Matrix3d sum = to_to + adjoint * from_from * adjoint.transpose() -
                              adjoint * from_to - from_to.transpose() * adjoint.transpose();
  return 0.5 * (sum + sum.transpose());
}

}  // namespace loci
