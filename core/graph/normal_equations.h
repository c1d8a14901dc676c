// SPDX-License-Identifier: Apache-2.0
// The sparse normal equations H step = -g of a least squares problem over small blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

namespace loci {

// Two blocks (variables) that a constraint joins; they differ.
struct BlockPair {
  std::uint32_t row = 0;
  std::uint32_t column = 0;
};

// H is symmetric, one block of rows and columns per variable. The elimination order (minimum degree
// over blocks) and the pattern of the factor are found once, in the constructor; the numbers may
// then be filled in and factorised any number of times. Eigen's own Cholesky, so that the bits
// depend on no BLAS (design.md, section 3).
class NormalEquations {
 public:
  // `pairs` in the order in which AddCross names them; duplicates share their place in H.
  NormalEquations(const std::vector<int>& block_sizes, const std::vector<BlockPair>& pairs);
  NormalEquations(const NormalEquations&) = delete;
  NormalEquations& operator=(const NormalEquations&) = delete;

  Eigen::Index size() const { return gradient_.size(); }
  Eigen::Index offset(std::uint32_t block) const { return offset_[block]; }

  // H = 0, g = 0.
  void Clear();

  // Adds a symmetric matrix to the diagonal block of `block`.
  template <int kSize>
  void AddDiagonal(std::uint32_t block, const Eigen::Matrix<double, kSize, kSize>& matrix) {
    const Eigen::Index first_column = permuted_offset_[block];
    for (int column = 0; column < kSize; ++column) {
      double* values = values_.valuePtr() + values_.outerIndexPtr()[first_column + column];
      for (int row = column; row < kSize; ++row) {
        values[row - column] += matrix(row, column);
      }
    }
  }

  // Adds a matrix to the block (pair.row, pair.column), and so its transpose to the mirrored one.
  template <int kRows, int kColumns>
  void AddCross(std::size_t pair, const Eigen::Matrix<double, kRows, kColumns>& matrix) {
    const Cell& cell = cells_[pair];
    if (cell.transposed) {
      AddBelow<kColumns, kRows>(cell, matrix.transpose());
    } else {
      AddBelow<kRows, kColumns>(cell, matrix);
    }
  }

  template <int kSize>
  void AddGradient(std::uint32_t block, const Eigen::Matrix<double, kSize, 1>& vector) {
    gradient_.segment<kSize>(offset_[block]) += vector;
  }

  // Factorises H + damping * D, where D is H's diagonal (an entry of it is at
  // least 1e-9 of the largest). False if that is not positive definite.
  bool Factor(double damping);

  // -(H + damping * D)^-1 g, in the order of the blocks. After a Factor() that succeeded.
  Eigen::VectorXd Step() const;
  // (H + damping * D)^-1 in the columns of `block`, as a dense matrix of size() rows.
  Eigen::MatrixXd InverseColumns(std::uint32_t block) const;

 private:
  // Where a cross block stands: below the diagonal, in the block column `column` of the permuted H.
  struct Cell {
    Eigen::Index column = 0;   // first scalar column
    std::ptrdiff_t below = 0;  // entries between the end of the diagonal block and this block
    bool transposed = false;
  };

  template <int kRows, int kColumns>
  void AddBelow(const Cell& cell, const Eigen::Matrix<double, kRows, kColumns>& matrix) {
    for (int column = 0; column < kColumns; ++column) {
      double* values = values_.valuePtr() + values_.outerIndexPtr()[cell.column + column] +
                       (kColumns - column) + cell.below;
      for (int row = 0; row < kRows; ++row) {
        values[row] += matrix(row, column);
      }
    }
  }

  void FindOrder(const std::vector<BlockPair>& pairs);
  void LayOut(const std::vector<BlockPair>& pairs);

  std::vector<int> block_sizes_;
  std::vector<Eigen::Index> offset_;           // of each block in step and gradient
  std::vector<std::uint32_t> position_;        // of each block in the elimination order
  std::vector<Eigen::Index> permuted_offset_;  // of each block in the permuted H
  std::vector<Cell> cells_;                    // per pair
  Eigen::SparseMatrix<double> values_;         // lower triangle of the permuted H
  Eigen::SparseMatrix<double> damped_;
  Eigen::VectorXd gradient_;  // not permuted
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>
      factor_;
};

// Adds what a constraint between two variables contributes to H and g: with e the error, J_a and
// J_b its Jacobians and W the weighted information, J^T W J and J^T W e. A block of kHeldBlock is
// left out.
inline constexpr std::uint32_t kHeldBlock = 0xFFFFFFFFU;

template <int kError, int kSizeA, int kSizeB>
struct LinearisedPair {
  Eigen::Matrix<double, kError, 1> error;
  Eigen::Matrix<double, kError, kSizeA> jacobian_a;
  Eigen::Matrix<double, kError, kSizeB> jacobian_b;
};

template <int kError, int kSizeA, int kSizeB>
void AddPair(const LinearisedPair<kError, kSizeA, kSizeB>& linearised,
             const Eigen::Matrix<double, kError, kError>& weight,
             std::uint32_t block_a,
             std::uint32_t block_b,
             std::size_t pair,
             NormalEquations& equations) {
  const Eigen::Matrix<double, kSizeA, kError> weighted_a =
      linearised.jacobian_a.transpose() * weight;
  const Eigen::Matrix<double, kSizeB, kError> weighted_b =
      linearised.jacobian_b.transpose() * weight;
  if (block_a != kHeldBlock) {
    equations.AddDiagonal<kSizeA>(block_a, weighted_a * linearised.jacobian_a);
    equations.AddGradient<kSizeA>(block_a, weighted_a * linearised.error);
  }
  if (block_b != kHeldBlock) {
    equations.AddDiagonal<kSizeB>(block_b, weighted_b * linearised.jacobian_b);
    equations.AddGradient<kSizeB>(block_b, weighted_b * linearised.error);
  }
  if (block_a != kHeldBlock && block_b != kHeldBlock) {
    equations.AddCross<kSizeA, kSizeB>(pair, weighted_a * linearised.jacobian_b);
  }
}

}  // namespace loci
