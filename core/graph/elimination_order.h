// SPDX-License-Identifier: Apache-2.0
// The order in which the variables of a sparse least squares problem are eliminated, and what is
// eliminated together.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace loci {

// Which variables stand together in some term. A clique says that all of its variables do.
struct VariableGraph {
  std::uint32_t count = 0;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;  // of two that differ
  std::vector<std::vector<std::uint32_t>> cliques;
};

// Approximate minimum degree (Eigen's, after Amestoy, Davis and Duff) over all variables but those
// of `last`, which follow in their order. Returns the variables, first eliminated first.
std::vector<std::uint32_t> EliminationOrder(const VariableGraph& graph,
                                            std::span<const std::uint32_t> last);

// Variables that are eliminated together, and those later ones that this joins.
struct SymbolicFront {
  std::uint32_t begin = 0;             // into SymbolicTree::variables
  std::uint32_t columns = 0;           // variables that it eliminates, in their order
  std::uint32_t rows = 0;              // the later ones, after them, in their order
  std::uint32_t parent = 0xFFFFFFFFU;  // the front that eliminates the first of the rows
};

struct SymbolicTree {
  std::vector<SymbolicFront> fronts;     // in postorder: a front follows all that is below it
  std::vector<std::uint32_t> variables;  // of the fronts
  std::vector<std::uint32_t> front_of;   // per variable
  std::vector<std::uint32_t> position;   // per variable: its place in the order
};

// Symbolic elimination in the given order. Variables whose columns are alike, or nearly, are
// gathered into fronts.
SymbolicTree AnalyseElimination(const VariableGraph& graph, std::span<const std::uint32_t> order);

}  // namespace loci
