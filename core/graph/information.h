// SPDX-License-Identifier: Apache-2.0
// Information matrices of constraints: what they must be.
#pragma once

#include <string>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "core/base/status.h"

namespace loci {

// kInvalidArgument, naming `field`, unless the matrix is finite, symmetric (to 1e-6 of its largest
// entry: information comes from text with six digits or so) and positive semidefinite (no
// eigenvalue below -1e-6 of the largest entry, for the same reason).
template <int kSize>
Status ValidateInformation(const Eigen::Matrix<double, kSize, kSize>& information,
                           const std::string& field) {
  constexpr double kRoundingOfText = 1e-6;
  if (!information.allFinite()) {
    return InvalidArgumentError(field + ": a number is not finite");
  }
  const double largest = information.cwiseAbs().maxCoeff();
  if ((information - information.transpose()).cwiseAbs().maxCoeff() > kRoundingOfText * largest) {
    return InvalidArgumentError(field + ": not symmetric");
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, kSize, kSize>> solver(
      information, Eigen::EigenvaluesOnly);
  const double smallest = solver.eigenvalues().minCoeff();
  if (smallest < -kRoundingOfText * largest) {
    return InvalidArgumentError(field + ": eigenvalue " + std::to_string(smallest) +
                                ", must be >= 0");
  }
  return {};
}

}  // namespace loci
