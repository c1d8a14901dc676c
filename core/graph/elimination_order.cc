// SPDX-License-Identifier: Apache-2.0
#include "core/graph/elimination_order.h"

#include <algorithm>
#include <cstddef>

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

namespace loci {
namespace {

constexpr std::uint32_t kNone = 0xFFFFFFFFU;

// Lists of numbers, one per variable, one after the other.
class Lists {
 public:
  // `pairs` gives (variable, number) to the function that it is called with, the same ones in the
  // same order each time.
  template <typename Pairs>
  Lists(std::size_t count, const Pairs& pairs) : begin_(count + 1, 0) {
    pairs([this](std::uint32_t variable, std::uint32_t) { ++begin_[variable + 1]; });
    for (std::size_t i = 0; i < count; ++i) {
      begin_[i + 1] += begin_[i];
    }
    numbers_.resize(begin_[count]);
    std::vector<std::uint32_t> end(begin_.begin(), begin_.end() - 1);
    pairs(
        [&](std::uint32_t variable, std::uint32_t number) { numbers_[end[variable]++] = number; });
  }
  std::span<const std::uint32_t> Of(std::uint32_t variable) const {
    return std::span(numbers_).subspan(begin_[variable], begin_[variable + 1] - begin_[variable]);
  }
  std::size_t size() const { return numbers_.size(); }

 private:
  std::vector<std::uint32_t> begin_;
  std::vector<std::uint32_t> numbers_;
};

// The columns of the factor, by their places in the order.
struct Columns {
  std::vector<std::uint32_t> begin;        // into `rows`; one more than there are columns
  std::vector<std::uint32_t> rows;         // places of what stands below, ascending
  std::vector<std::uint32_t> first_child;  // in the elimination tree
  std::vector<std::uint32_t> sibling;

  std::span<const std::uint32_t> Below(std::uint32_t p) const {
    return std::span(rows).subspan(begin[p], begin[p + 1] - begin[p]);
  }
};

Columns FindColumns(const VariableGraph& graph,
                    std::span<const std::uint32_t> order,
                    std::span<const std::uint32_t> position) {
  const Lists later(graph.count, [&](const auto& add) {
    for (const auto& [a, b] : graph.edges) {
      const auto [first, second] = std::minmax(position[a], position[b]);
      add(first, second);
    }
  });
  const Lists cliques(graph.count, [&](const auto& add) {
    for (std::uint32_t i = 0; i < graph.cliques.size(); ++i) {
      std::uint32_t first = kNone;
      for (const std::uint32_t variable : graph.cliques[i]) {
        first = std::min(first, position[variable]);
      }
      if (first != kNone) {
        add(first, i);
      }
    }
  });
  const auto count = static_cast<std::uint32_t>(order.size());
  Columns columns;
  columns.begin.reserve(count + 1);
  columns.begin.push_back(0);
  columns.rows.reserve(4 * (count + graph.edges.size()));
  columns.first_child.assign(count, kNone);
  columns.sibling.assign(count, kNone);
  std::vector<std::uint32_t> seen(count, kNone);
  std::vector<std::uint32_t> rows;
  for (std::uint32_t p = 0; p < count; ++p) {
    rows.clear();
    seen[p] = p;
    const auto add = [&](std::uint32_t q) {
      if (seen[q] != p) {
        seen[q] = p;
        rows.push_back(q);
      }
    };
    std::for_each(later.Of(p).begin(), later.Of(p).end(), add);
    for (const std::uint32_t clique : cliques.Of(p)) {
      for (const std::uint32_t variable : graph.cliques[clique]) {
        add(position[variable]);
      }
    }
    for (std::uint32_t c = columns.first_child[p]; c != kNone; c = columns.sibling[c]) {
      const std::span<const std::uint32_t> below = columns.Below(c);
      std::for_each(below.begin(), below.end(), add);
    }
    std::sort(rows.begin(), rows.end());
    if (!rows.empty()) {
      columns.sibling[p] = columns.first_child[rows.front()];
      columns.first_child[rows.front()] = p;
    }
    columns.rows.insert(columns.rows.end(), rows.begin(), rows.end());
    columns.begin.push_back(static_cast<std::uint32_t>(columns.rows.size()));
  }
  return columns;
}

// Entries of a front that eliminates so many columns.
double EntryCount(std::size_t columns, std::size_t rows) {
  return static_cast<double>(columns) *
         (0.5 * static_cast<double>(columns + 1) + static_cast<double>(rows));
}

// Larger fronts are faster a number, if not too many of the numbers are zeros that need not be
// there. Measured on the Manhattan and city graphs.
bool IsWorthMerging(std::size_t columns, std::size_t rows, double true_entries) {
  const double zeros = 1.0 - true_entries / EntryCount(columns, rows);
  if (columns <= 4) {
    return zeros <= 0.2;
  }
  return zeros <= (columns <= 8 ? 0.1 : columns <= 16 ? 0.05 : 0.02);
}

// The places at which fronts end: a front takes its children in, as they come, where that pays.
// Gives for every place the end of the front that eliminates it.
std::vector<std::uint32_t> FindEnds(const Columns& columns) {
  const auto count = static_cast<std::uint32_t>(columns.first_child.size());
  std::vector<std::uint32_t> end(count);
  std::vector<std::uint32_t> size(count, 1);
  std::vector<double> true_entries(count);
  for (std::uint32_t p = 0; p < count; ++p) {
    const std::size_t rows = columns.Below(p).size();
    end[p] = p;
    true_entries[p] = 1.0 + static_cast<double>(rows);
    for (std::uint32_t c = columns.first_child[p]; c != kNone; c = columns.sibling[c]) {
      const double entries = true_entries[p] + true_entries[c];
      if (IsWorthMerging(size[p] + size[c], rows, entries)) {
        end[c] = p;
        true_entries[p] = entries;
        size[p] += size[c];
      }
    }
  }
  for (std::uint32_t p = count; p-- > 0;) {
    end[p] = end[end[p]];
  }
  return end;
}

// The ends of fronts in postorder.
std::vector<std::uint32_t> PostorderOfFronts(const Columns& columns,
                                             std::span<const std::uint32_t> end) {
  const auto count = static_cast<std::uint32_t>(end.size());
  std::vector<std::uint32_t> first_child(count, kNone);
  std::vector<std::uint32_t> sibling(count, kNone);
  std::vector<std::uint32_t> stack;
  for (std::uint32_t p = 0; p < count; ++p) {
    if (end[p] != p) {
      continue;
    }
    if (columns.Below(p).empty()) {
      stack.push_back(p);
    } else {
      const std::uint32_t parent = end[columns.Below(p).front()];
      sibling[p] = first_child[parent];
      first_child[parent] = p;
    }
  }
  // Parents before their children, and each with all that is below it in one piece: turned round.
  std::vector<std::uint32_t> order;
  order.reserve(count);
  while (!stack.empty()) {
    const std::uint32_t p = stack.back();
    stack.pop_back();
    order.push_back(p);
    for (std::uint32_t c = first_child[p]; c != kNone; c = sibling[c]) {
      stack.push_back(c);
    }
  }
  std::reverse(order.begin(), order.end());
  return order;
}

// The symmetric pattern's lower triangle over the variables that have a column.
Eigen::SparseMatrix<float> PatternOf(const VariableGraph& graph,
                                     std::span<const int> column,
                                     int count) {
  const Lists joined(static_cast<std::size_t>(count), [&](const auto& add) {
    const auto join = [&](std::uint32_t a, std::uint32_t b) {
      if (column[a] >= 0 && column[b] >= 0) {
        const auto [first, second] = std::minmax(column[a], column[b]);
        add(static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(second));
      }
    };
    for (const auto& [a, b] : graph.edges) {
      join(a, b);
    }
    // Edge by edge: a column of its own for each clique would be shorter, but then the order has
    // tens of times the fill.
    for (const std::vector<std::uint32_t>& clique : graph.cliques) {
      for (std::size_t i = 0; i < clique.size(); ++i) {
        for (std::size_t j = i + 1; j < clique.size(); ++j) {
          join(clique[i], clique[j]);
        }
      }
    }
  });
  Eigen::SparseMatrix<float> pattern(count, count);
  pattern.resizeNonZeros(static_cast<Eigen::Index>(joined.size()) + count);
  std::vector<int> seen(static_cast<std::size_t>(count), -1);
  int size = 0;
  for (int i = 0; i < count; ++i) {
    pattern.outerIndexPtr()[i] = size;
    pattern.innerIndexPtr()[size++] = i;
    for (const std::uint32_t j : joined.Of(static_cast<std::uint32_t>(i))) {
      if (seen[j] != i) {
        seen[j] = i;
        pattern.innerIndexPtr()[size++] = static_cast<int>(j);
      }
    }
  }
  pattern.outerIndexPtr()[count] = size;
  pattern.resizeNonZeros(size);
  std::fill_n(pattern.valuePtr(), size, 1.0F);
  return pattern;
}

}  // namespace

std::vector<std::uint32_t> EliminationOrder(const VariableGraph& graph,
                                            std::span<const std::uint32_t> last) {
  constexpr int kLast = -1;
  std::vector<int> column(graph.count, 0);
  for (const std::uint32_t variable : last) {
    column[variable] = kLast;
  }
  std::vector<std::uint32_t> variables;  // of the columns
  variables.reserve(graph.count);
  for (std::uint32_t variable = 0; variable < graph.count; ++variable) {
    if (column[variable] != kLast) {
      column[variable] = static_cast<int>(variables.size());
      variables.push_back(variable);
    }
  }
  std::vector<std::uint32_t> order;
  order.reserve(graph.count);
  if (!variables.empty()) {
    const auto count = static_cast<int>(variables.size());
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
    Eigen::AMDOrdering<int>()(PatternOf(graph, column, count).selfadjointView<Eigen::Lower>(),
                              permutation);
    for (int i = 0; i < count; ++i) {
      order.push_back(variables[static_cast<std::size_t>(permutation.indices()[i])]);
    }
  }
  order.insert(order.end(), last.begin(), last.end());
  return order;
}

SymbolicTree AnalyseElimination(const VariableGraph& graph, std::span<const std::uint32_t> order) {
  const auto count = static_cast<std::uint32_t>(order.size());
  SymbolicTree tree;
  tree.position.resize(count);
  for (std::uint32_t p = 0; p < count; ++p) {
    tree.position[order[p]] = p;
  }
  const Columns columns = FindColumns(graph, order, tree.position);
  const std::vector<std::uint32_t> end = FindEnds(columns);
  const std::vector<std::uint32_t> ends = PostorderOfFronts(columns, end);
  tree.fronts.resize(ends.size());
  std::vector<std::uint32_t> front_at(count, kNone);
  for (std::uint32_t i = 0; i < ends.size(); ++i) {
    front_at[ends[i]] = i;
    tree.fronts[i].rows = static_cast<std::uint32_t>(columns.Below(ends[i]).size());
  }
  tree.front_of.resize(count);
  for (std::uint32_t p = 0; p < count; ++p) {
    tree.front_of[order[p]] = front_at[end[p]];
    ++tree.fronts[front_at[end[p]]].columns;
  }
  std::uint32_t size = 0;
  for (SymbolicFront& front : tree.fronts) {
    front.begin = size;
    size += front.columns + front.rows;
    front.columns = 0;
  }
  tree.variables.resize(size);
  for (std::uint32_t p = 0; p < count; ++p) {
    SymbolicFront& front = tree.fronts[front_at[end[p]]];
    tree.variables[front.begin + front.columns++] = order[p];
  }
  for (std::uint32_t i = 0; i < ends.size(); ++i) {
    SymbolicFront& front = tree.fronts[i];
    std::uint32_t at = front.begin + front.columns;
    for (const std::uint32_t p : columns.Below(ends[i])) {
      tree.variables[at++] = order[p];
    }
    if (front.rows > 0) {
      front.parent = front_at[end[columns.Below(ends[i]).front()]];
    }
  }
  return tree;
}

}  // namespace loci
