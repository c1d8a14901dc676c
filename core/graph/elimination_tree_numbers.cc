// SPDX-License-Identifier: Apache-2.0
// The numbers of the fronts: elimination and solution.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/graph/dense_front.h"
#include "core/graph/elimination_tree.h"

namespace loci {
namespace {

// A pivot of at most this part of the diagonal that it was before anything was eliminated is
// rounding: what it would be is lost in the last digits of the sums that have left it. Far below
// what stiff graphs leave where they are determined: 1e-12, where a chain of 1 mm has a tie of 1
// km.
constexpr double kRounding = 16.0 * std::numeric_limits<double>::epsilon();

}  // namespace

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

namespace {

// Runs are of few poses: three at a time costs less than what the compiler makes of a plain loop.
inline void Add(const double* from, std::ptrdiff_t count, double* to) {
  std::ptrdiff_t i = 0;
  for (; i + 3 <= count; i += 3) {
    to[i] += from[i];
    to[i + 1] += from[i + 1];
    to[i + 2] += from[i + 2];
  }
  for (; i < count; ++i) {
    to[i] += from[i];
  }
}

// Numbers [begin, end): mostly so few that a call of std::copy costs more than the copying.
inline void CopySome(const double* from, std::size_t begin, std::size_t end, double* to) {
  std::size_t i = begin;
  for (; i + 4 <= end; i += 4) {
    std::memcpy(to + i, from + i, 4 * sizeof(double));
  }
  for (; i < end; ++i) {
    to[i] = from[i];
  }
}

// The same as Scatter for two variables of kSize numbers each, the most frequent of all, at rows
// `a` and `b` of the front at hand.
template <int kSize>
[[gnu::noinline]] void ScatterTwo(const double* values,
                                  std::ptrdiff_t stride,
                                  std::ptrdiff_t a,
                                  std::ptrdiff_t b,
                                  std::ptrdiff_t size,
                                  double* work) {
  using Block = Eigen::Matrix<double, kSize, kSize>;
  const std::ptrdiff_t work_stride = StrideOf(size);
  const double* const values_b = values + kSize * (stride + 1);
  double* const columns_a = work + a * work_stride;
  double* const columns_b = work + b * work_stride;
#pragma GCC unroll 6
  for (int j = 0; j < kSize; ++j) {
#pragma GCC unroll 6
    for (int i = j; i < kSize; ++i) {
      columns_a[j * work_stride + a + i] += values[j * stride + i];
      columns_b[j * work_stride + b + i] += values_b[j * stride + i];
    }
    columns_a[j * work_stride + size] += values[j * stride + 2 * kSize];
    columns_b[j * work_stride + size] += values_b[j * stride + kSize];
  }
  const Block mixed = Eigen::Map<const Block, 0, Eigen::OuterStride<>>(
      values + kSize, Eigen::OuterStride<>(stride));
  const Eigen::OuterStride<> outer(work_stride);
  if (a < b) {
    Eigen::Map<Block, 0, Eigen::OuterStride<>>(columns_a + b, outer) += mixed;
  } else {  // above the diagonal: mirrored
    Eigen::Map<Block, 0, Eigen::OuterStride<>>(columns_b + a, outer) += mixed.transpose();
  }
}

}  // namespace

// Adds a matrix over some variables, with its right-hand side in the row after them, to the front
// at hand, which has them all and `size` numbers.
void EliminationTree::Scatter(std::span<const std::uint32_t> variables,
                              const double* values,
                              std::ptrdiff_t stride,
                              std::ptrdiff_t size) {
  if (variables.size() == 2) {
    const Variable& a = variables_[variables[0]];
    const Variable& b = variables_[variables[1]];
    if (a.size == 3 && b.size == 3) {
      ScatterTwo<3>(values, stride, a.row, b.row, size, work_.data());
      return;
    }
    if (a.size == 1 && b.size == 1) {
      ScatterTwo<1>(values, stride, a.row, b.row, size, work_.data());
      return;
    }
    if (a.size == 6 && b.size == 6) {
      ScatterTwo<6>(values, stride, a.row, b.row, size, work_.data());
      return;
    }
  }
  ScatterRuns(variables, values, stride, size);
}

void EliminationTree::ScatterRuns(std::span<const std::uint32_t> variables,
                                  const double* values,
                                  std::ptrdiff_t stride,
                                  std::ptrdiff_t size) {
  double* const work = work_.data();
  FindRuns(variables);
  const std::ptrdiff_t right_row = runs_.back().source + runs_.back().count;
  const std::ptrdiff_t work_stride = StrideOf(size);
  for (std::size_t c = 0; c < runs_.size(); ++c) {
    const Run& run = runs_[c];
    for (std::ptrdiff_t j = 0; j < run.count; ++j) {
      const double* from = values + (run.source + j) * stride;
      double* to = work + (run.target + j) * work_stride;
      Add(from + run.source + j, run.count - j, to + run.target + j);
      for (std::size_t r = c + 1; r < runs_.size(); ++r) {
        if (runs_[r].target > run.target) {
          Add(from + runs_[r].source, runs_[r].count, to + runs_[r].target);
          continue;
        }
        // Above the diagonal: mirrored.
        double* mirrored = work + runs_[r].target * work_stride + run.target + j;
        for (std::ptrdiff_t i = 0; i < runs_[r].count; ++i) {
          mirrored[i * work_stride] += from[runs_[r].source + i];
        }
      }
      to[size] += from[right_row];
    }
  }
}

// Puts together what a front eliminates: its terms, and the complements of its children.
void EliminationTree::Assemble(const Front& front, bool complements_are_kept) {
  const auto size = static_cast<std::ptrdiff_t>(front.size);
  const std::ptrdiff_t stride = StrideOf(size);
  double* const work = work_.Grow(static_cast<std::size_t>(stride * size), 0);
  for (std::ptrdiff_t j = 0; j < size; ++j) {
    const std::ptrdiff_t begin = std::max<std::ptrdiff_t>(0, (j & ~std::ptrdiff_t{3}) - 4);
    std::fill_n(work + j * stride + begin, stride - begin, 0.0);
  }
  std::uint32_t row = 0;
  for (const std::uint32_t variable : front.variables) {
    variables_[variable].row = row;
    row += static_cast<std::uint32_t>(variables_[variable].size);
  }
  for (std::uint32_t i = 0; i < front.eliminated; ++i) {
    const std::uint32_t variable = front.variables[i];
    for (std::uint32_t use = variables_[variable].first_use; use != kNone; use = uses_[use].next) {
      const Term& term = terms_[uses_[use].term];
      if (term.first == variable) {
        const double* values = &term_values_[term.values];
        for (std::uint32_t k = 0; k < term.size; ++k) {
          diagonal_max_ = std::max(diagonal_max_, values[std::size_t{k} * (term.size + 2)]);
        }
        Scatter(VariablesOf(term), values, term.size + 1, size);
      }
    }
  }
  for (const std::uint32_t c : front.children) {
    const Front& child = fronts_[c];
    if (child.size > child.columns) {
      const double* complements = complements_are_kept ? child.values.data() : stack_.data();
      Scatter(RowsOf(child),
              complements + child.complement,
              StrideOf(child.size - child.columns),
              size);
    }
  }
}

// The diagonal of H for a variable, as its terms have it: before anything was eliminated.
void EliminationTree::AddDiagonalOf(std::uint32_t variable, double* diagonal) const {
  const int size = variables_[variable].size;
  for (std::uint32_t use = variables_[variable].first_use; use != kNone; use = uses_[use].next) {
    const Term& term = terms_[uses_[use].term];
    std::size_t at = 0;
    for (std::uint32_t i = term.begin; i < use; ++i) {
      at += static_cast<std::size_t>(variables_[term_variables_[i]].size);
    }
    const double* values = &term_values_[term.values + at * (term.size + 2)];
    for (int k = 0; k < size; ++k) {
      diagonal[k] += values[static_cast<std::size_t>(k) * (term.size + 2)];
    }
  }
}

// Whether what was left of each number of the diagonal, the square of L's, is more than rounding.
bool EliminationTree::IsDetermined(const Front& front) {
  const std::ptrdiff_t stride = StrideOf(front.size);
  const auto left_of = [&](std::uint32_t k) {
    const double root = work_.data()[k * (stride + 1)];
    return root * root;
  };
  double least = std::numeric_limits<double>::infinity();
  for (std::uint32_t k = 0; k < front.columns; ++k) {
    least = std::min(least, left_of(k));
  }
  // No diagonal is larger than that of the largest term, times their number.
  if (least > kRounding * diagonal_max_ * static_cast<double>(terms_.size())) {
    return true;
  }
  std::vector<double> diagonal(front.columns, 0.0);
  double* at = diagonal.data();
  for (std::uint32_t i = 0; i < front.eliminated; ++i) {
    AddDiagonalOf(front.variables[i], at);
    at += variables_[front.variables[i]].size;
  }
  bool is_determined = true;
  for (std::uint32_t k = 0; k < front.columns; ++k) {
    is_determined = is_determined && left_of(k) > kRounding * diagonal[k];
  }
  return is_determined;
}

bool EliminationTree::EliminateFront(Front& front, bool keep_complement) {
  Assemble(front, keep_complement);
  const std::ptrdiff_t stride = StrideOf(front.size);
  if (!EliminateColumns(work_.data(), front.size, front.columns) || !IsDetermined(front)) {
    return false;
  }
  const std::size_t factor_count = static_cast<std::size_t>(stride) * front.columns;
  const std::size_t rest = front.size - front.columns;
  const auto rest_stride = static_cast<std::size_t>(StrideOf(static_cast<std::ptrdiff_t>(rest)));
  double* complement = nullptr;
  if (keep_complement) {
    front.values.Renew(factor_count + rest * rest_stride);
    front.complement = factor_count;
    complement = front.values.data() + factor_count;
  } else {
    front.values.Renew(factor_count);
    // Fronts come in postorder: the children's complements are the last on the stack.
    for (const std::uint32_t child : front.children) {
      stack_size_ = std::min(stack_size_, fronts_[child].complement);
    }
    front.complement = stack_size_;
    complement = stack_.Grow(stack_size_ + rest * rest_stride, stack_size_) + stack_size_;
    stack_size_ += rest * rest_stride;
  }
  std::copy_n(work_.data(), factor_count, front.values.data());
  const double* from = work_.data() + front.columns * static_cast<std::size_t>(stride + 1);
  for (std::size_t j = 0; j < rest; ++j) {
    CopySome(
        from + j * static_cast<std::size_t>(stride), j, rest + 1, complement + j * rest_stride);
  }
  return true;
}

void EliminationTree::SolveFront(Front& front, double change_min) {
  x_.resize(front.size);
  std::size_t row = front.columns;
  for (std::size_t i = front.eliminated; i < front.variables.size(); ++i) {
    const Variable& variable = variables_[front.variables[i]];
    CopySome(&value_[variable.offset], 0, static_cast<std::size_t>(variable.size), &x_[row]);
    row += static_cast<std::size_t>(variable.size);
  }
  SolveColumns(front.values.data(), front.size, front.columns, x_.data());
  row = 0;
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
    }
  }
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

}  // namespace loci
