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

 private:
  std::vector<std::uint32_t> begin_;
  std::vector<std::uint32_t> numbers_;
};

// The columns of the factor, by their places in the order.
struct Columns {
  std::vector<std::vector<std::uint32_t>> below;  // places of what stands below, ascending
  std::vector<std::uint32_t> first_child;         // in the elimination tree
  std::vector<std::uint32_t> sibling;
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
  Columns columns{std::vector<std::vector<std::uint32_t>>(count),
                  std::vector<std::uint32_t>(count, kNone),
                  std::vector<std::uint32_t>(count, kNone)};
  std::vector<std::uint32_t> seen(count, kNone);
  for (std::uint32_t p = 0; p < count; ++p) {
    std::vector<std::uint32_t>& rows = columns.below[p];
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
      std::for_each(columns.below[c].begin(), columns.below[c].end(), add);
    }
    std::sort(rows.begin(), rows.end());
    if (!rows.empty()) {
      columns.sibling[p] = columns.first_child[rows.front()];
      columns.first_child[rows.front()] = p;
    }
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

}  // namespace

std::vector<std::uint32_t> EliminationOrder(const VariableGraph& graph,
                                            std::span<const std::uint32_t> last) {
  constexpr int kLast = -1;
  std::vector<int> column(graph.count, 0);
  for (const std::uint32_t variable : last) {
    column[variable] = kLast;
  }
  std::vector<std::uint32_t> variables;  // of the columns
  for (std::uint32_t variable = 0; variable < graph.count; ++variable) {
    if (column[variable] != kLast) {
      column[variable] = static_cast<int>(variables.size());
      variables.push_back(variable);
    }
  }
  std::vector<std::uint32_t> order;
  order.reserve(graph.count);
  if (!variables.empty()) {
    std::vector<Eigen::Triplet<double, int>> entries;
    const auto join = [&](std::uint32_t a, std::uint32_t b) {
      if (column[a] != kLast && column[b] != kLast) {
        entries.emplace_back(column[a], column[b], 1.0);
        entries.emplace_back(column[b], column[a], 1.0);
      }
    };
    for (int i = 0; i < static_cast<int>(variables.size()); ++i) {
      entries.emplace_back(i, i, 1.0);
    }
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
    const auto count = static_cast<Eigen::Index>(variables.size());
    Eigen::SparseMatrix<double> pattern(count, count);
    pattern.setFromTriplets(entries.begin(), entries.end());
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
    Eigen::AMDOrdering<int>()(pattern, permutation);
    for (Eigen::Index i = 0; i < count; ++i) {
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

  // A front ends at the place of its last column; children are merged with it as they come.
  std::vector<std::uint32_t> end(count);
  std::vector<std::vector<std::uint32_t>> gathered(count);
  std::vector<double> true_entries(count);
  for (std::uint32_t p = 0; p < count; ++p) {
    const std::size_t rows = columns.below[p].size();
    end[p] = p;
    true_entries[p] = 1.0 + static_cast<double>(rows);
    std::size_t size = 1;
    for (std::uint32_t c = columns.first_child[p]; c != kNone; c = columns.sibling[c]) {
      const std::size_t merged = size + gathered[c].size();
      const double entries = true_entries[p] + true_entries[c];
      if (IsWorthMerging(merged, rows, entries)) {
        end[c] = p;
        true_entries[p] = entries;
        size = merged;
        gathered[p].insert(gathered[p].end(), gathered[c].begin(), gathered[c].end());
        gathered[c].clear();
      }
    }
    gathered[p].push_back(p);
  }
  std::vector<std::uint32_t> front_at(count, kNone);
  const auto variables_at = [&order](const std::vector<std::uint32_t>& places) {
    std::vector<std::uint32_t> variables(places.size());
    std::transform(
        places.begin(), places.end(), variables.begin(), [&](std::uint32_t p) { return order[p]; });
    return variables;
  };
  for (std::uint32_t p = 0; p < count; ++p) {
    if (end[p] == p) {
      front_at[p] = static_cast<std::uint32_t>(tree.fronts.size());
      tree.fronts.push_back({variables_at(gathered[p]), variables_at(columns.below[p]), kNone});
    }
  }
  tree.front_of.resize(count);
  for (std::uint32_t p = count; p-- > 0;) {
    end[p] = end[end[p]];
    tree.front_of[order[p]] = front_at[end[p]];
  }
  for (SymbolicFront& front : tree.fronts) {
    if (!front.rows.empty()) {
      front.parent = tree.front_of[front.rows.front()];
    }
  }
  return tree;
}

}  // namespace loci
