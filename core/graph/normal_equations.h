// SPDX-License-Identifier: Apache-2.0
// The sparse normal equations H step = -g of a least squares problem over small blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/graph/elimination_tree.h"

namespace loci {

// Two blocks (variables) that a constraint joins; they differ.
struct BlockPair {
  std::uint32_t row = 0;
  std::uint32_t column = 0;
};

inline constexpr std::uint32_t kHeldBlock = 0xFFFFFFFFU;

// H is symmetric, one block of rows and columns per variable. The elimination order and the pattern
// of the factor are found once, at the first Factor(); the numbers may then be filled in and
// factorised any number of times. The factorisation is our own (EliminationTree), so that the bits
// depend on no BLAS (design.md, section 3).
class NormalEquations {
 public:
  // `pairs` in the order in which SetPair names them; they may be there more than once.
  NormalEquations(const std::vector<int>& block_sizes, const std::vector<BlockPair>& pairs);
  NormalEquations(const NormalEquations&) = delete;
  NormalEquations& operator=(const NormalEquations&) = delete;

  Eigen::Index size() const { return size_; }
  Eigen::Index offset(std::uint32_t block) const { return offset_[block]; }

  // H = 0, g = 0, but for the pairs.
  void Clear();

  // Adds a symmetric matrix to the diagonal block of `block`.
  template <int kSize>
  void AddDiagonal(std::uint32_t block, const Eigen::Matrix<double, kSize, kSize>& matrix) {
    double* values = OwnTerm(block);
    for (int column = 0; column < kSize; ++column) {
      for (int row = column; row < kSize; ++row) {
        values[column * (kSize + 1) + row] += matrix(row, column);
      }
    }
  }

  template <int kSize>
  void AddGradient(std::uint32_t block, const Eigen::Matrix<double, kSize, 1>& vector) {
    double* values = OwnTerm(block);
    for (int column = 0; column < kSize; ++column) {
      values[column * (kSize + 1) + kSize] -= vector(column);
    }
  }

  // Sets the symmetric matrix over both blocks of a pair, `row` before `column`, and what belongs
  // to it of the gradient. After Clear, every pair must be set.
  template <int kSize>
  void SetPair(std::size_t pair,
               const Eigen::Matrix<double, kSize, kSize>& matrix,
               const Eigen::Matrix<double, kSize, 1>& vector) {
    double* values = tree_.TermValues(pair_term_[pair]);
    for (int column = 0; column < kSize; ++column) {
      double* to = values + column * (kSize + 1);
      for (int row = column; row < kSize; ++row) {
        to[row] = matrix(row, column);
      }
      to[kSize] = -vector(column);
    }
  }

  // Factorises H + damping * D, where D is H's diagonal (an entry of it is at
  // least 1e-9 of the largest). False if that is not positive definite.
  bool Factor(double damping);

  // -(H + damping * D)^-1 g, in the order of the blocks. After a Factor() that succeeded.
  Eigen::VectorXd Step();
  // The block (row, column) of (H + damping * D)^-1. Costs what stands above the two in the
  // elimination tree.
  Eigen::MatrixXd InverseBlock(std::uint32_t row, std::uint32_t column) const;

 private:
  static constexpr std::uint32_t kNone = EliminationTree::kNone;

  double* OwnTerm(std::uint32_t block);
  Eigen::VectorXd Diagonal() const;

  std::vector<int> block_sizes_;
  std::vector<Eigen::Index> offset_;  // of each block in step and gradient
  Eigen::Index size_ = 0;
  EliminationTree tree_;                 // blocks are its variables
  std::vector<std::uint32_t> own_term_;  // per block; kNone: it needs none so far
  std::vector<std::uint32_t> pair_term_;
  std::vector<BlockPair> pairs_;
  Eigen::VectorXd damping_;  // what Factor has added to the diagonal
};

template <int kError, int kSizeA, int kSizeB>
struct LinearisedPair {
  Eigen::Matrix<double, kError, 1> error;
  Eigen::Matrix<double, kError, kSizeA> jacobian_a;
  Eigen::Matrix<double, kError, kSizeB> jacobian_b;
};

// Adds what a constraint between two variables contributes to H and g: with e the error, J_a and
// J_b its Jacobians and W the weighted information, J^T W J and J^T W e. A block of kHeldBlock is
// left out.
template <int kError, int kSizeA, int kSizeB>
void AddPair(const LinearisedPair<kError, kSizeA, kSizeB>& linearised,
             const Eigen::Matrix<double, kError, kError>& weight,
             std::uint32_t block_a,
             std::uint32_t block_b,
             std::size_t pair,
             NormalEquations& equations) {
  if (block_a != kHeldBlock && block_b != kHeldBlock) {
    Eigen::Matrix<double, kError, kSizeA + kSizeB> jacobian;
    jacobian << linearised.jacobian_a, linearised.jacobian_b;
    const Eigen::Matrix<double, kSizeA + kSizeB, kError> weighted = jacobian.transpose() * weight;
    equations.SetPair<kSizeA + kSizeB>(pair, weighted * jacobian, weighted * linearised.error);
    return;
  }
  const auto add = [&](const auto& jacobian, std::uint32_t block) {
    constexpr int kSize = std::decay_t<decltype(jacobian)>::ColsAtCompileTime;
    const Eigen::Matrix<double, kSize, kError> weighted = jacobian.transpose() * weight;
    equations.AddDiagonal<kSize>(block, weighted * jacobian);
    equations.AddGradient<kSize>(block, weighted * linearised.error);
  };
  if (block_a != kHeldBlock) {
    add(linearised.jacobian_a, block_a);
  }
  if (block_b != kHeldBlock) {
    add(linearised.jacobian_b, block_b);
  }
}

}  // namespace loci
