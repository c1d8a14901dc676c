// SPDX-License-Identifier: Apache-2.0
// The sparse normal equations H step = -g of a least squares problem over small blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/graph/elimination_tree.h"
#include "core/graph/linearised_pair.h"

namespace loci {

// Two blocks (variables) that a constraint joins; they differ.
struct BlockPair {
  std::uint32_t row = 0;
  std::uint32_t column = 0;
};

// Blocks that one term joins, one or more of them, no two equal.
using BlockGroup = std::vector<std::uint32_t>;

inline constexpr std::uint32_t kHeldBlock = 0xFFFFFFFFU;

// H is symmetric, one block of rows and columns per variable. The elimination order and the pattern
// of the factor are found once, at the first Factor(); the numbers may then be filled in and
// factorised any number of times. The factorisation is our own (EliminationTree), so that the bits
// depend on no BLAS (design.md, section 3).
class NormalEquations {
 public:
  // `pairs` and `groups` in the order in which PairValues and GroupValues name them; they may be
  // there more than once.
  NormalEquations(const std::vector<int>& block_sizes,
                  const std::vector<BlockPair>& pairs,
                  const std::vector<BlockGroup>& groups = {});
  NormalEquations(const NormalEquations&) = delete;
  NormalEquations& operator=(const NormalEquations&) = delete;
  NormalEquations(NormalEquations&&) = default;
  NormalEquations& operator=(NormalEquations&&) = default;

  // Equations over as many blocks of `block_size`, and the same pairs; the elimination order is
  // found only once for both.
  NormalEquations Resized(int block_size);

  Eigen::Index size() const { return size_; }
  Eigen::Index offset(std::uint32_t block) const { return offset_[block]; }

  // H = 0, g = 0, but for the pairs and groups.
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

  // The term of a pair, `row` before `column`, or of a group, to be written
  // (EliminationTree::SetTerm). After Clear, every pair and every group must be.
  double* PairValues(std::size_t pair) { return tree_.TermValues(pair_term_[pair]); }
  double* GroupValues(std::size_t group) { return tree_.TermValues(group_term_[group]); }

  // Factorises H + damping * D, where D is H's diagonal (an entry of it is at
  // least 1e-9 of the largest). False if that is not positive definite.
  bool Factor(double damping);

  // -(H + damping * D)^-1 g, in the order of the blocks. After a Factor() that succeeded.
  Eigen::VectorXd Step();
  // The block (row, column) of (H + damping * D)^-1. Costs what stands above the two in the
  // elimination tree.
  Eigen::MatrixXd InverseBlock(std::uint32_t row, std::uint32_t column) const;
  // a^T (H + damping * D)^-1 a for a matrix that has rows for these blocks only, in their order; no
  // two of them equal. Positive semidefinite, whatever is rounded.
  Eigen::MatrixXd InverseForm(std::span<const std::uint32_t> blocks,
                              const Eigen::MatrixXd& a) const;

 private:
  static constexpr std::uint32_t kNone = EliminationTree::kNone;

  NormalEquations(const std::vector<int>& block_sizes, EliminationTree tree);

  double* OwnTerm(std::uint32_t block);
  Eigen::VectorXd Diagonal() const;

  std::vector<int> block_sizes_;
  std::vector<Eigen::Index> offset_;  // of each block in step and gradient
  Eigen::Index size_ = 0;
  EliminationTree tree_;                 // blocks are its variables
  std::vector<std::uint32_t> own_term_;  // per block; kNone: it needs none so far
  std::vector<std::uint32_t> pair_term_;
  std::vector<BlockPair> pairs_;
  std::vector<std::uint32_t> group_term_;
  std::vector<BlockGroup> groups_;
  Eigen::VectorXd damping_;  // what Factor has added to the diagonal
};

// Adds J^T W J and J^T W e of an error that depends on one block; nothing if that is kHeldBlock.
template <int kError, int kSize>
void AddSingle(const Eigen::Matrix<double, kError, 1>& error,
               const Eigen::Matrix<double, kError, kSize>& jacobian,
               const Eigen::Matrix<double, kError, kError>& weight,
               std::uint32_t block,
               NormalEquations& equations) {
  if (block == kHeldBlock) {
    return;
  }
  const Eigen::Matrix<double, kSize, kError> weighted = jacobian.transpose() * weight;
  equations.AddDiagonal<kSize>(block, weighted * jacobian);
  equations.AddGradient<kSize>(block, weighted * error);
}

// The same of a constraint between two blocks, either of which may be kHeldBlock.
template <int kError, int kSizeA, int kSizeB>
void AddPair(const LinearisedPair<kError, kSizeA, kSizeB>& linearised,
             const Eigen::Matrix<double, kError, kError>& weight,
             std::uint32_t block_a,
             std::uint32_t block_b,
             std::size_t pair,
             NormalEquations& equations) {
  if (block_a != kHeldBlock && block_b != kHeldBlock) {
    WriteTerm(linearised, weight, true, true, equations.PairValues(pair));
    return;
  }
  AddSingle(linearised.error, linearised.jacobian_a, weight, block_a, equations);
  AddSingle(linearised.error, linearised.jacobian_b, weight, block_b, equations);
}

}  // namespace loci
