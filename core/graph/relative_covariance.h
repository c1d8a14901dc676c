// SPDX-License-Identifier: Apache-2.0
// How well the pose of one node relative to another is known, from how well all are.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/se2.h"

namespace loci {

// Covariance of from_from_to * Exp(xi), (x, y, theta), right perturbation: to first order,
// xi = xi_to - Adjoint(to_from_from) * xi_from. From the covariance of both, it would be the
// difference of what may be large, and be negative for rounding; `inverse_form(variables, a)` gives
// a^T H^-1 a, H the information of all (EliminationTree::InverseForm). Nodes that are held have no
// variable: `variable_of(node)` is `none`.
template <typename VariableOf, typename InverseForm>
Eigen::Matrix3d RelativeCovarianceOf(std::uint32_t from,
                                     std::uint32_t to,
                                     const Pose2& to_from_from,
                                     std::uint32_t none,
                                     const VariableOf& variable_of,
                                     const InverseForm& inverse_form) {
  std::vector<std::uint32_t> variables;
  Eigen::MatrixXd a(6, 3);
  Eigen::Index rows = 0;
  const auto add = [&](std::uint32_t variable, const Eigen::Matrix3d& block) {
    if (variable != none) {
      variables.push_back(variable);
      a.middleRows<3>(rows) = block;
      rows += 3;
    }
  };
  if (from != to) {
    add(variable_of(from), -Adjoint(to_from_from).transpose());
    add(variable_of(to), Eigen::Matrix3d::Identity());
  }
  if (rows == 0) {
    return Eigen::Matrix3d::Zero();
  }
  return inverse_form(variables, a.topRows(rows));
}

}  // namespace loci
