// SPDX-License-Identifier: Apache-2.0
// The normal equations as terms of an elimination tree.
#include "core/graph/normal_equations.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/base/check.h"

namespace loci {
namespace {

// A direction without any information still gets this part of the largest diagonal entry when the
// equations are damped, so that enough damping always makes them positive definite.
constexpr double kDiagonalMinRelative = 1e-9;

}  // namespace

NormalEquations::NormalEquations(const std::vector<int>& block_sizes,
                                 const std::vector<BlockPair>& pairs,
                                 const std::vector<BlockGroup>& groups)
    : NormalEquations(block_sizes, EliminationTree()) {
  pairs_ = pairs;
  groups_ = groups;
  tree_.Reserve(block_sizes_.size(), pairs_.size());
  for (const int block_size : block_sizes_) {
    tree_.AddVariable(block_size);
  }
  pair_term_.reserve(pairs_.size());
  for (const BlockPair& pair : pairs_) {
    LOCI_CHECK(pair.row != pair.column);
    const std::array<std::uint32_t, 2> variables{pair.row, pair.column};
    pair_term_.push_back(tree_.AddTerm(variables));
  }
  for (const BlockGroup& group : groups_) {
    group_term_.push_back(tree_.AddTerm(group));
  }
}

NormalEquations::NormalEquations(const std::vector<int>& block_sizes, EliminationTree tree)
    : block_sizes_(block_sizes), tree_(std::move(tree)) {
  offset_.reserve(block_sizes_.size());
  for (const int block_size : block_sizes_) {
    offset_.push_back(size_);
    size_ += block_size;
  }
  own_term_.assign(block_sizes_.size(), kNone);
  damping_ = Eigen::VectorXd::Zero(size_);
}

NormalEquations NormalEquations::Resized(int block_size) {
  tree_.Order();
  NormalEquations resized(std::vector<int>(block_sizes_.size(), block_size),
                          tree_.Resized(block_size));
  resized.pairs_ = pairs_;
  resized.pair_term_ = pair_term_;
  resized.groups_ = groups_;
  resized.group_term_ = group_term_;
  return resized;
}

void NormalEquations::Clear() {
  for (std::uint32_t block = 0; block < block_sizes_.size(); ++block) {
    if (own_term_[block] != kNone) {
      std::fill_n(
          tree_.TermValues(own_term_[block]), block_sizes_[block] * (block_sizes_[block] + 1), 0.0);
    }
  }
  damping_.setZero();
}

double* NormalEquations::OwnTerm(std::uint32_t block) {
  if (own_term_[block] == kNone) {
    const std::array<std::uint32_t, 1> variable{block};
    own_term_[block] = tree_.AddTerm(variable);
  }
  return tree_.TermValues(own_term_[block]);
}

Eigen::VectorXd NormalEquations::Diagonal() const {
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(size_);
  for (std::uint32_t block = 0; block < block_sizes_.size(); ++block) {
    if (own_term_[block] == kNone) {
      continue;
    }
    const double* values = tree_.TermValues(own_term_[block]);
    for (int i = 0; i < block_sizes_[block]; ++i) {
      diagonal(offset_[block] + i) = values[i * (block_sizes_[block] + 1) + i];
    }
  }
  for (std::size_t pair = 0; pair < pairs_.size(); ++pair) {
    const double* values = tree_.TermValues(pair_term_[pair]);
    const int rows = block_sizes_[pairs_[pair].row];
    const int all = rows + block_sizes_[pairs_[pair].column];
    for (int i = 0; i < all; ++i) {
      const Eigen::Index at =
          i < rows ? offset_[pairs_[pair].row] + i : offset_[pairs_[pair].column] + i - rows;
      diagonal(at) += values[i * (all + 1) + i];
    }
  }
  for (std::size_t group = 0; group < groups_.size(); ++group) {
    const double* values = tree_.TermValues(group_term_[group]);
    std::ptrdiff_t all = 0;
    for (const std::uint32_t block : groups_[group]) {
      all += block_sizes_[block];
    }
    std::ptrdiff_t at = 0;
    for (const std::uint32_t block : groups_[group]) {
      for (int i = 0; i < block_sizes_[block]; ++i, ++at) {
        diagonal(offset_[block] + i) += values[at * (all + 1) + at];
      }
    }
  }
  return diagonal;
}

bool NormalEquations::Factor(double damping) {
  if (size_ == 0) {
    return true;
  }
  Eigen::VectorXd added = Eigen::VectorXd::Zero(size_);
  if (damping > 0.0) {
    const Eigen::VectorXd diagonal = Diagonal() - damping_;
    added = damping * diagonal.cwiseMax(kDiagonalMinRelative * diagonal.maxCoeff());
  }
  for (std::uint32_t block = 0; block < block_sizes_.size(); ++block) {
    if (own_term_[block] == kNone && damping == 0.0) {
      continue;
    }
    double* values = OwnTerm(block);
    for (int i = 0; i < block_sizes_[block]; ++i) {
      const Eigen::Index at = offset_[block] + i;
      values[i * (block_sizes_[block] + 1) + i] += added(at) - damping_(at);
    }
  }
  damping_ = added;
  return tree_.EliminateAll();
}

Eigen::VectorXd NormalEquations::Step() {
  std::vector<std::uint32_t> solved;
  tree_.Solve(0.0, solved);
  Eigen::VectorXd step(size_);
  for (std::uint32_t block = 0; block < block_sizes_.size(); ++block) {
    std::copy_n(tree_.Value(block), block_sizes_[block], step.data() + offset_[block]);
  }
  return step;
}

Eigen::MatrixXd NormalEquations::InverseBlock(std::uint32_t row, std::uint32_t column) const {
  return tree_.InverseBlock(row, column);
}

Eigen::MatrixXd NormalEquations::InverseForm(std::span<const std::uint32_t> blocks,
                                             const Eigen::MatrixXd& a) const {
  return tree_.InverseForm(blocks, a);
}

}  // namespace loci
