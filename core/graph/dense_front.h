// SPDX-License-Identifier: Apache-2.0
// The dense part of a sparse factorisation: partial Cholesky factorisation of one front.
#pragma once

#include <cstddef>

namespace loci {

// A front is a dense matrix, column by column, whose lower triangle counts. `size` columns; row
// `size` holds the right-hand side; `stride`, the distance of columns, is StrideOf(size). What lies
// above the diagonal, and below row `size`, is undefined.
constexpr std::ptrdiff_t StrideOf(std::ptrdiff_t size) {
  return (size + 4) & ~std::ptrdiff_t{3};  // size + 1 rows, in fours
}

// Eliminates the first `columns` columns: they become those of the factor L (with L^-1 b in row
// `size`), the rest becomes the Schur complement. False if a pivot is not positive. Sums are taken
// in a fixed order without fused operations: the same bits on every processor.
bool EliminateColumns(double* front, std::ptrdiff_t size, std::ptrdiff_t columns);

// Solves for the variables of the first `columns` columns of an eliminated front, given those of
// the rest: L_ff^T x_f = y_f - L_sf^T x_s. `x` has `size` entries, the last of them given.
void SolveColumns(const double* front, std::ptrdiff_t size, std::ptrdiff_t columns, double* x);

// The same without AVX2, whatever the processor has: what the fast ones are tested against.
bool EliminateColumnsPlainly(double* front, std::ptrdiff_t size, std::ptrdiff_t columns);
void SolveColumnsPlainly(const double* front,
                         std::ptrdiff_t size,
                         std::ptrdiff_t columns,
                         double* x);

}  // namespace loci
