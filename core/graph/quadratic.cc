// SPDX-License-Identifier: Apache-2.0
// Schur complements by eigenvalues, so that no rank is assumed.
#include "core/graph/quadratic.h"

#include <algorithm>
#include <limits>

#include <Eigen/Eigenvalues>

namespace loci {
namespace {

// Metres and radians differ, and so do the units in which information comes: matrices are scaled to
// a diagonal of about one. Rounding is far below this, what a lever of some kilometres leaves of an
// information is above.
constexpr double kUnknownRelative = 1e-12;

// What rounding leaves of a direction that has been taken away, as measured for nodes of up to
// seven neighbours: up to 13 epsilon over the least eigenvalue of the part that takes it away.
constexpr double kRounding = 16.0 * std::numeric_limits<double>::epsilon();

// H = D V diag(lambda) V^T D, with D = sqrt(scale) and lambda 0 where it is unknown.
class ScaledEigenvalues {
 public:
  ScaledEigenvalues(const Eigen::MatrixXd& h,
                    const Eigen::VectorXd& scale,
                    double unknown = kUnknownRelative)
      : root_(scale.cwiseMax(0.0).cwiseSqrt()),
        inverse_root_(
            (root_.array() > 0.0).select(root_.cwiseInverse(), Eigen::VectorXd::Zero(h.rows()))),
        solver_(inverse_root_.asDiagonal() * h * inverse_root_.asDiagonal()),
        lambda_((solver_.eigenvalues().array() > unknown)
                    .select(solver_.eigenvalues(), Eigen::VectorXd::Zero(h.rows()))) {}

  Eigen::Index rank() const { return (lambda_.array() > 0.0).count(); }
  bool is_full() const { return rank() == lambda_.size(); }
  // Of what is known; 1 if nothing is.
  double LeastKnown() const {
    return (lambda_.array() > 0.0)
        .select(lambda_, Eigen::VectorXd::Ones(lambda_.size()))
        .minCoeff();
  }

  Eigen::MatrixXd Matrix() const {
    const Eigen::MatrixXd v = root_.asDiagonal() * solver_.eigenvectors();
    return v * lambda_.asDiagonal() * v.transpose();
  }
  Eigen::MatrixXd PseudoInverse() const {
    const Eigen::MatrixXd v = inverse_root_.asDiagonal() * solver_.eigenvectors();
    const Eigen::VectorXd inverse =
        (lambda_.array() > 0.0)
            .select(lambda_.cwiseInverse(), Eigen::VectorXd::Zero(lambda_.size()));
    return v * inverse.asDiagonal() * v.transpose();
  }

 private:
  Eigen::VectorXd root_;
  Eigen::VectorXd inverse_root_;
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver_;
  Eigen::VectorXd lambda_;
};

}  // namespace

Eigen::VectorXd Minimum(const Quadratic& form, const Eigen::VectorXd& scale) {
  return ScaledEigenvalues(form.h, scale).PseudoInverse() * form.b;
}

RankedInverse PseudoInverse(const Eigen::MatrixXd& h, const Eigen::VectorXd& scale) {
  const ScaledEigenvalues values(h, scale);
  const Eigen::MatrixXd inverse = values.PseudoInverse();
  return {0.5 * (inverse + inverse.transpose()), values.rank()};
}

Quadratic MinimisedOverRest(const Quadratic& form, Eigen::Index kept) {
  const Eigen::Index rest = form.b.size() - kept;
  if (rest == 0) {
    return form;
  }
  const Eigen::MatrixXd rest_block = form.h.bottomRightCorner(rest, rest);
  const ScaledEigenvalues rest_values(rest_block, rest_block.diagonal());
  const Eigen::MatrixXd gain = form.h.topRightCorner(kept, rest) * rest_values.PseudoInverse();
  const Eigen::MatrixXd h =
      form.h.topLeftCorner(kept, kept) - gain * form.h.bottomLeftCorner(rest, kept);
  Quadratic result;
  result.h = 0.5 * (h + h.transpose());
  result.b = form.b.head(kept) - gain * form.b.tail(rest);
  // Where all was taken away, rounding is left; it must not pass for information, nor be negative.
  // What is far above rounding stays, however little it is: which of two nodes is kept must not
  // decide whether a weak constraint between them counts.
  const ScaledEigenvalues known(result.h,
                                form.h.diagonal().head(kept),
                                std::min(kUnknownRelative, kRounding / rest_values.LeastKnown()));
  if (!known.is_full()) {
    const Eigen::MatrixXd matrix = known.Matrix();
    result.h = 0.5 * (matrix + matrix.transpose());
  }
  return result;
}

}  // namespace loci
