// SPDX-License-Identifier: Apache-2.0
// Pattern, order and factor of the normal equations.
#include "core/graph/normal_equations.h"

#include <algorithm>
#include <numeric>

#include <Eigen/OrderingMethods>

#include "core/base/check.h"

namespace loci {
namespace {

// A direction without any information still gets this part of the largest diagonal entry when the
// equations are damped, so that enough damping always makes them positive definite.
constexpr double kDiagonalMinRelative = 1e-9;

}  // namespace

NormalEquations::NormalEquations(const std::vector<int>& block_sizes,
                                 const std::vector<BlockPair>& pairs)
    : block_sizes_(block_sizes), offset_(block_sizes.size()) {
  Eigen::Index size = 0;
  for (std::size_t block = 0; block < block_sizes_.size(); ++block) {
    offset_[block] = size;
    size += block_sizes_[block];
  }
  gradient_ = Eigen::VectorXd::Zero(size);
  FindOrder(pairs);
  LayOut(pairs);
  if (size > 0) {
    factor_.analyzePattern(values_);
  }
}

void NormalEquations::FindOrder(const std::vector<BlockPair>& pairs) {
  const Eigen::Index count = static_cast<Eigen::Index>(block_sizes_.size());
  std::vector<Eigen::Triplet<double, int>> entries;
  entries.reserve(2 * pairs.size() + block_sizes_.size());
  for (int block = 0; block < count; ++block) {
    entries.emplace_back(block, block, 1.0);
  }
  for (const BlockPair& pair : pairs) {
    LOCI_CHECK(pair.row != pair.column);
    entries.emplace_back(static_cast<int>(pair.row), static_cast<int>(pair.column), 1.0);
    entries.emplace_back(static_cast<int>(pair.column), static_cast<int>(pair.row), 1.0);
  }
  Eigen::SparseMatrix<double> pattern(count, count);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  if (count > 0) {
    Eigen::AMDOrdering<int>()(pattern, order);
  }
  position_.resize(block_sizes_.size());
  permuted_offset_.resize(block_sizes_.size());
  Eigen::Index offset = 0;
  for (Eigen::Index position = 0; position < count; ++position) {
    const auto block = static_cast<std::size_t>(order.indices()[position]);
    position_[block] = static_cast<std::uint32_t>(position);
    permuted_offset_[block] = offset;
    offset += block_sizes_[block];
  }
}

void NormalEquations::LayOut(const std::vector<BlockPair>& pairs) {
  // The cross blocks, as (column block, row block) with the row below, sorted by their place.
  struct Place {
    std::uint32_t column = 0;
    std::uint32_t row = 0;
  };
  std::vector<Place> places(pairs.size());
  cells_.resize(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    cells_[i].transposed = position_[pairs[i].row] < position_[pairs[i].column];
    places[i] = cells_[i].transposed ? Place{pairs[i].row, pairs[i].column}
                                     : Place{pairs[i].column, pairs[i].row};
  }
  std::vector<std::size_t> sorted(pairs.size());
  std::iota(sorted.begin(), sorted.end(), std::size_t{0});
  const auto key = [&](std::size_t i) {
    return std::make_pair(position_[places[i].column], position_[places[i].row]);
  };
  std::sort(sorted.begin(), sorted.end(), [&](std::size_t a, std::size_t b) {
    return std::make_pair(key(a), a) < std::make_pair(key(b), b);
  });

  std::vector<std::vector<std::uint32_t>> rows(block_sizes_.size());  // per column block, in order
  std::vector<std::ptrdiff_t> filled(block_sizes_.size(), 0);
  for (const std::size_t i : sorted) {
    const Place& place = places[i];
    std::vector<std::uint32_t>& column_rows = rows[place.column];
    if (column_rows.empty() || column_rows.back() != place.row) {
      column_rows.push_back(place.row);
      filled[place.column] += block_sizes_[place.row];
    }
    cells_[i].column = permuted_offset_[place.column];
    cells_[i].below = filled[place.column] - block_sizes_[place.row];
  }

  std::vector<std::size_t> block_at(block_sizes_.size());
  for (std::size_t block = 0; block < block_sizes_.size(); ++block) {
    block_at[position_[block]] = block;
  }
  values_.resize(size(), size());
  for (const std::size_t block : block_at) {
    for (int column = 0; column < block_sizes_[block]; ++column) {
      const Eigen::Index scalar_column = permuted_offset_[block] + column;
      values_.startVec(scalar_column);
      for (int row = column; row < block_sizes_[block]; ++row) {
        values_.insertBack(permuted_offset_[block] + row, scalar_column) = 0.0;
      }
      for (const std::uint32_t row_block : rows[block]) {
        for (int row = 0; row < block_sizes_[row_block]; ++row) {
          values_.insertBack(permuted_offset_[row_block] + row, scalar_column) = 0.0;
        }
      }
    }
  }
  values_.finalize();
  damped_ = values_;
}

void NormalEquations::Clear() {
  std::fill_n(values_.valuePtr(), values_.nonZeros(), 0.0);
  gradient_.setZero();
}

bool NormalEquations::Factor(double damping) {
  if (size() == 0) {
    return true;
  }
  if (damping == 0.0) {
    factor_.factorize(values_);
  } else {
    std::copy_n(values_.valuePtr(), values_.nonZeros(), damped_.valuePtr());
    double largest = 0.0;
    for (Eigen::Index i = 0; i < size(); ++i) {
      largest = std::max(largest, values_.valuePtr()[values_.outerIndexPtr()[i]]);
    }
    for (Eigen::Index i = 0; i < size(); ++i) {
      double& diagonal = damped_.valuePtr()[damped_.outerIndexPtr()[i]];
      diagonal += damping * std::max(diagonal, kDiagonalMinRelative * largest);
    }
    factor_.factorize(damped_);
  }
  return factor_.info() == Eigen::Success && (factor_.vectorD().array() > 0.0).all();
}

Eigen::VectorXd NormalEquations::Step() const {
  Eigen::VectorXd step(size());
  if (size() == 0) {
    return step;
  }
  Eigen::VectorXd permuted(size());
  for (std::size_t block = 0; block < block_sizes_.size(); ++block) {
    permuted.segment(permuted_offset_[block], block_sizes_[block]) =
        -gradient_.segment(offset_[block], block_sizes_[block]);
  }
  const Eigen::VectorXd solution = factor_.solve(permuted);
  for (std::size_t block = 0; block < block_sizes_.size(); ++block) {
    step.segment(offset_[block], block_sizes_[block]) =
        solution.segment(permuted_offset_[block], block_sizes_[block]);
  }
  return step;
}

Eigen::MatrixXd NormalEquations::InverseColumns(std::uint32_t block) const {
  Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(size(), block_sizes_[block]);
  unit.middleRows(permuted_offset_[block], block_sizes_[block]).setIdentity();
  const Eigen::MatrixXd solution = factor_.solve(unit);
  Eigen::MatrixXd columns(size(), block_sizes_[block]);
  for (std::size_t other = 0; other < block_sizes_.size(); ++other) {
    columns.middleRows(offset_[other], block_sizes_[other]) =
        solution.middleRows(permuted_offset_[other], block_sizes_[other]);
  }
  return columns;
}

}  // namespace loci
