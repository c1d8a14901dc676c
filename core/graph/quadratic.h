// SPDX-License-Identifier: Apache-2.0
// Small dense quadratic forms, whatever their rank: minimised over some of their variables.
#pragma once

#include <Eigen/Core>

namespace loci {

// 1/2 x^T H x - b^T x with H positive semidefinite and b in its range: it has a minimum.
struct Quadratic {
  Eigen::MatrixXd h;
  Eigen::VectorXd b;
};

// An x of the least value, the shortest of them; each direction that H says nothing about stays 0.
// `scale` is the diagonal of a matrix that H is a part of or came from, in whose units a direction
// counts as unknown: below 1e-12.
Eigen::VectorXd Minimum(const Quadratic& form, const Eigen::VectorXd& scale);

// Pseudo-inverse and rank of H, in the same sense.
struct RankedInverse {
  Eigen::MatrixXd inverse;
  Eigen::Index rank = 0;
};
RankedInverse PseudoInverse(const Eigen::MatrixXd& h, const Eigen::VectorXd& scale);

// The form of the first `kept` variables that remains when the others take the value that is best
// for each value of these (Schur complement). Directions that become unknown are exactly so: those
// in which no more is left than rounding may leave, and at most 1e-12 of what was there.
Quadratic MinimisedOverRest(const Quadratic& form, Eigen::Index kept);

}  // namespace loci
