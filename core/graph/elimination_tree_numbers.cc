// SPDX-License-Identifier: Apache-2.0
// The numbers of the fronts: elimination, solution and blocks of the inverse.
#include <algorithm>
#include <cmath>
#include <map>

#include "core/graph/dense_front.h"
#include "core/graph/elimination_tree.h"

namespace loci {

// Where the variables' rows go in the front at hand; neighbours that stay neighbours are one run.
void EliminationTree::FindRuns(std::span<const std::uint32_t> variables) {
  runs_.clear();
  std::ptrdiff_t source = 0;
  for (const std::uint32_t variable : variables) {
    const auto target = static_cast<std::ptrdiff_t>(variables_[variable].row);
    const std::ptrdiff_t size = variables_[variable].size;
    if (!runs_.empty() && runs_.back().target + runs_.back().count == target) {
      runs_.back().count += size;
    } else {
      runs_.push_back({source, target, size});
    }
    source += size;
  }
}

// Adds a matrix over some variables, with its right-hand side, to a front that has them all.
void EliminationTree::Scatter(std::span<const std::uint32_t> variables,
                              const double* values,
                              std::ptrdiff_t stride,
                              std::ptrdiff_t right_row,
                              Front& front) {
  FindRuns(variables);
  const std::ptrdiff_t front_stride = StrideOf(front.size);
  for (std::size_t c = 0; c < runs_.size(); ++c) {
    const Run& run = runs_[c];
    for (std::ptrdiff_t j = 0; j < run.count; ++j) {
      const double* from = values + (run.source + j) * stride;
      double* to = front.values.data() + (run.target + j) * front_stride;
      for (std::ptrdiff_t i = j; i < run.count; ++i) {
        to[run.target + i] += from[run.source + i];
      }
      for (std::size_t r = c + 1; r < runs_.size(); ++r) {
        // Below the diagonal, or mirrored to there.
        const bool below = runs_[r].target > run.target;
        double* first = below
                            ? to + runs_[r].target
                            : front.values.data() + runs_[r].target * front_stride + run.target + j;
        const std::ptrdiff_t step = below ? 1 : front_stride;
        for (std::ptrdiff_t i = 0; i < runs_[r].count; ++i) {
          first[i * step] += from[runs_[r].source + i];
        }
      }
      to[front.size] += from[right_row];
    }
  }
}

bool EliminationTree::EliminateFront(std::uint32_t index) {
  Front& front = fronts_[index];
  const std::ptrdiff_t stride_of = StrideOf(front.size);
  front.values.resize(static_cast<std::size_t>(stride_of) * front.size);
  for (std::ptrdiff_t j = 0; j < static_cast<std::ptrdiff_t>(front.size); ++j) {
    const std::ptrdiff_t begin = std::max<std::ptrdiff_t>(0, (j & ~std::ptrdiff_t{3}) - 4);
    std::fill_n(front.values.data() + j * stride_of + begin, stride_of - begin, 0.0);
  }
  std::uint32_t row = 0;
  for (const std::uint32_t variable : front.variables) {
    variables_[variable].row = row;
    row += static_cast<std::uint32_t>(variables_[variable].size);
  }
  for (std::uint32_t i = 0; i < front.eliminated; ++i) {
    const std::uint32_t variable = front.variables[i];
    for (const std::uint32_t t : variables_[variable].terms) {
      const Term& term = terms_[t];
      if (term.first == variable) {
        Scatter(VariablesOf(term), &term_values_[term.values], term.size + 1, term.size, front);
      }
    }
  }
  for (const std::uint32_t c : front.children) {
    const Front& child = fronts_[c];
    const std::ptrdiff_t stride = StrideOf(child.size);
    Scatter(std::span<const std::uint32_t>(child.variables).subspan(child.eliminated),
            child.values.data() + child.columns * stride + child.columns,
            stride,
            static_cast<std::ptrdiff_t>(child.size - child.columns),
            front);
  }
  return EliminateColumns(front.values.data(), front.size, front.columns);
}

bool EliminationTree::SolveFront(Front& front, double change_min) {
  x_.resize(front.size + 4);
  std::size_t row = front.columns;
  for (std::size_t i = front.eliminated; i < front.variables.size(); ++i) {
    const Variable& variable = variables_[front.variables[i]];
    std::copy_n(&value_[variable.offset], variable.size, &x_[row]);
    row += static_cast<std::size_t>(variable.size);
  }
  SolveColumns(front.values.data(), front.size, front.columns, x_.data());
  row = 0;
  bool any = false;
  for (std::uint32_t i = 0; i < front.eliminated; ++i) {
    const Variable& variable = variables_[front.variables[i]];
    double change = 0.0;
    for (int k = 0; k < variable.size; ++k, ++row) {
      value_[variable.offset + static_cast<std::uint32_t>(k)] = x_[row];
      change = std::max(
          change, std::abs(x_[row] - spread_[variable.offset + static_cast<std::uint32_t>(k)]));
    }
    if (change > change_min) {
      std::copy_n(&value_[variable.offset], variable.size, &spread_[variable.offset]);
      moved_[front.variables[i]] = round_;
      any = true;
    }
  }
  return any;
}

void EliminationTree::Solve(double change_min, std::vector<std::uint32_t>& solved) {
  ++round_;
  // Top fronts first; what is solved puts its children on the stack.
  std::vector<std::uint32_t> stack;
  for (const std::uint32_t index : fresh_) {
    const std::uint32_t parent = fronts_[index].parent;
    if (parent == kNone || !fronts_[parent].fresh) {
      stack.push_back(index);
    }
  }
  while (!stack.empty()) {
    const std::uint32_t index = stack.back();
    stack.pop_back();
    Front& front = fronts_[index];
    bool due = front.fresh;
    for (std::size_t i = front.eliminated; i < front.variables.size() && !due; ++i) {
      due = moved_[front.variables[i]] == round_;
    }
    if (!due) {
      continue;
    }
    SolveFront(front, change_min);
    solved.insert(
        solved.end(), front.variables.begin(), front.variables.begin() + front.eliminated);
    for (const std::uint32_t child : front.children) {
      stack.push_back(child);
    }
  }
  for (const std::uint32_t index : fresh_) {
    fronts_[index].fresh = false;
  }
  fresh_.clear();
}

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
  using Factor = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  const auto factor_of = [](const Front& front) {
    return Factor(
        front.values.data(), front.size, front.columns, Eigen::OuterStride<>(StrideOf(front.size)));
  };
  const Eigen::Index count = variables_[column].size;
  std::map<std::uint32_t, Eigen::MatrixXd> x;  // per variable
  const auto rows_of = [&](const Front& front) {
    Eigen::MatrixXd rows(front.size, count);
    Eigen::Index at = 0;
    for (const std::uint32_t variable : front.variables) {
      const auto found = x.find(variable);
      const Eigen::Index size = variables_[variable].size;
      if (found != x.end()) {
        rows.middleRows(at, size) = found->second;
      } else {
        rows.middleRows(at, size).setZero();
      }
      at += size;
    }
    return rows;
  };
  const auto keep = [&](const Front& front, const Eigen::MatrixXd& rows, std::size_t end) {
    Eigen::Index at = 0;
    for (std::size_t i = 0; i < end; ++i) {
      const Eigen::Index size = variables_[front.variables[i]].size;
      x[front.variables[i]] = rows.middleRows(at, size);
      at += size;
    }
  };
  x[column] = Eigen::MatrixXd::Identity(count, count);
  for (const std::uint32_t index : PathOf(column)) {
    const Front& front = fronts_[index];
    const Factor factor = factor_of(front);
    Eigen::MatrixXd rows = rows_of(front);
    const Eigen::Index columns = front.columns;
    factor.topRows(columns).triangularView<Eigen::Lower>().solveInPlace(rows.topRows(columns));
    rows.bottomRows(front.size - columns) -=
        factor.bottomRows(front.size - columns) * rows.topRows(columns);
    keep(front, rows, front.variables.size());
  }
  const std::vector<std::uint32_t> path = PathOf(row);
  for (std::size_t i = path.size(); i-- > 0;) {
    const Front& front = fronts_[path[i]];
    const Factor factor = factor_of(front);
    Eigen::MatrixXd rows = rows_of(front);
    const Eigen::Index columns = front.columns;
    rows.topRows(columns) -=
        factor.bottomRows(front.size - columns).transpose() * rows.bottomRows(front.size - columns);
    factor.topRows(columns).triangularView<Eigen::Lower>().transpose().solveInPlace(
        rows.topRows(columns));
    keep(front, rows, front.eliminated);
  }
  return x[row];
}

}  // namespace loci
