// SPDX-License-Identifier: Apache-2.0
// A constraint between two variables, linearised, and the quadratic term that follows.
#pragma once

#include <cstddef>

#include <Eigen/Core>

namespace loci {

template <int kError, int kSizeA, int kSizeB>
struct LinearisedPair {
  Eigen::Matrix<double, kError, 1> error;
  Eigen::Matrix<double, kError, kSizeA> jacobian_a;
  Eigen::Matrix<double, kError, kSizeB> jacobian_b;
};

// Writes H = J^T W J and b = -J^T W e as a term of an EliminationTree. A variable that is not free
// is left out.
template <int kError, int kSizeA, int kSizeB>
void WriteTerm(const LinearisedPair<kError, kSizeA, kSizeB>& linearised,
               const Eigen::Matrix<double, kError, kError>& weight,
               bool a_is_free,
               bool b_is_free,
               double* values) {
  constexpr int kSize = kSizeA + kSizeB;
  Eigen::Matrix<double, kError, kSize> jacobian;
  jacobian << linearised.jacobian_a, linearised.jacobian_b;
  const Eigen::Matrix<double, kSize, kError> weighted = jacobian.transpose() * weight;
  const Eigen::Matrix<double, kSize, kSize> h = weighted * jacobian;
  const Eigen::Matrix<double, kSize, 1> b = -(weighted * linearised.error);
  const int begin = a_is_free ? 0 : kSizeA;
  const int end = b_is_free ? kSize : kSizeA;
  const int stride = end - begin + 1;
  for (int column = begin; column < end; ++column) {
    double* to = values + static_cast<std::ptrdiff_t>(column - begin) * stride;
    for (int row = column; row < end; ++row) {
      to[row - begin] = h(row, column);
    }
    to[end - begin] = b(column);
  }
}

}  // namespace loci
