// SPDX-License-Identifier: Apache-2.0
// Blocks and forms of the inverse, from the fronts that they concern.
#include <algorithm>
#include <map>
#include <vector>

#include "core/base/check.h"
#include "core/graph/dense_front.h"
#include "core/graph/elimination_tree.h"

namespace loci {

// Rows of right-hand sides or solutions, by variable; those that are not there are zero.
class EliminationTree::SparseRows {
 public:
  SparseRows(const EliminationTree& tree, Eigen::Index columns) : tree_(tree), columns_(columns) {}

  Eigen::MatrixXd& operator[](std::uint32_t variable) { return rows_[variable]; }

  // L y = b for the variables that a front eliminates, whose part of y is returned; b of those
  // above changes.
  Eigen::MatrixXd SolveUp(const Front& front) {
    const auto factor = FactorOf(front);
    Eigen::MatrixXd rows = RowsOf(front);
    const Eigen::Index eliminated = front.columns;
    factor.topRows(eliminated)
        .triangularView<Eigen::Lower>()
        .solveInPlace(rows.topRows(eliminated));
    rows.bottomRows(front.size - eliminated) -=
        factor.bottomRows(front.size - eliminated) * rows.topRows(eliminated);
    Keep(front, rows, front.variables.size());
    return rows.topRows(eliminated);
  }

  // L^T x = y for the variables that a front eliminates, those above solved.
  void SolveDown(const Front& front) {
    const auto factor = FactorOf(front);
    Eigen::MatrixXd rows = RowsOf(front);
    const Eigen::Index eliminated = front.columns;
    rows.topRows(eliminated) -= factor.bottomRows(front.size - eliminated).transpose() *
                                rows.bottomRows(front.size - eliminated);
    factor.topRows(eliminated)
        .triangularView<Eigen::Lower>()
        .transpose()
        .solveInPlace(rows.topRows(eliminated));
    Keep(front, rows, front.eliminated);
  }

 private:
  using Factor = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

  static Factor FactorOf(const Front& front) {
    return {
        front.values.data(), front.size, front.columns, Eigen::OuterStride<>(StrideOf(front.size))};
  }

  Eigen::MatrixXd RowsOf(const Front& front) const {
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(front.size, columns_);
    Eigen::Index at = 0;
    for (const std::uint32_t variable : front.variables) {
      const Eigen::Index size = tree_.variables_[variable].size;
      if (const auto found = rows_.find(variable); found != rows_.end()) {
        rows.middleRows(at, size) = found->second;
      }
      at += size;
    }
    return rows;
  }

  void Keep(const Front& front, const Eigen::MatrixXd& rows, std::size_t end) {
    Eigen::Index at = 0;
    for (std::size_t i = 0; i < end; ++i) {
      const Eigen::Index size = tree_.variables_[front.variables[i]].size;
      rows_[front.variables[i]] = rows.middleRows(at, size);
      at += size;
    }
  }

  const EliminationTree& tree_;
  Eigen::Index columns_ = 0;
  std::map<std::uint32_t, Eigen::MatrixXd> rows_;
};

// The fronts from that of a variable up to the root.
std::vector<std::uint32_t> EliminationTree::PathOf(std::uint32_t variable) const {
  std::vector<std::uint32_t> path;
  for (std::uint32_t front = variables_[variable].front; front != kNone;
       front = fronts_[front].parent) {
    path.push_back(front);
  }
  return path;
}

// Solves H x = unit columns. Going up, only fronts above `column` see anything; going down, only
// those above `row` are asked.
Eigen::MatrixXd EliminationTree::InverseBlock(std::uint32_t row, std::uint32_t column) const {
  const Eigen::Index count = variables_[column].size;
  SparseRows x(*this, count);
  x[column] = Eigen::MatrixXd::Identity(count, count);
  for (const std::uint32_t front : PathOf(column)) {
    x.SolveUp(fronts_[front]);
  }
  const std::vector<std::uint32_t> path = PathOf(row);
  std::for_each(
      path.rbegin(), path.rend(), [&](std::uint32_t front) { x.SolveDown(fronts_[front]); });
  return x[row];
}

// With H = L L^T and L y = a, the form is y^T y.
Eigen::MatrixXd EliminationTree::InverseForm(std::span<const std::uint32_t> variables,
                                             const Eigen::MatrixXd& a) const {
  SparseRows y(*this, a.cols());
  std::vector<std::uint32_t> fronts;
  Eigen::Index at = 0;
  for (const std::uint32_t variable : variables) {
    const Eigen::Index size = variables_[variable].size;
    y[variable] = a.middleRows(at, size);
    at += size;
    const std::vector<std::uint32_t> path = PathOf(variable);
    fronts.insert(fronts.end(), path.begin(), path.end());
  }
  LOCI_CHECK(at == a.rows());
  // Children before their parents.
  std::sort(fronts.begin(), fronts.end(), [this](std::uint32_t left, std::uint32_t right) {
    return fronts_[left].sequence < fronts_[right].sequence;
  });
  fronts.erase(std::unique(fronts.begin(), fronts.end()), fronts.end());
  Eigen::MatrixXd form = Eigen::MatrixXd::Zero(a.cols(), a.cols());
  for (const std::uint32_t front : fronts) {
    const Eigen::MatrixXd part = y.SolveUp(fronts_[front]);
    form += part.transpose() * part;
  }
  return form;
}

}  // namespace loci
