// SPDX-License-Identifier: Apache-2.0
// The largest sets of things that agree with each other.
//
// After J. G. Mangelson, D. Dominic, R. M. Eustice, R. Vasudevan: "Pairwise Consistent Measurement
// Set Maximization for Robust Multi-Robot Map Merging" (ICRA 2018), where such a set is a maximum
// clique of the graph of agreeing pairs. Here not every pair has been tried, so that there are
// three answers: a link (they agree, and chance is no reason for it), a conflict, or nothing known.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace loci {

struct ConsistencyGraph {
  std::vector<double> weights;  // of the items, > 0
  std::vector<std::pair<std::uint32_t, std::uint32_t>> links;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> conflicts;
};

// Items of a component that have conflicts, up to which its heaviest subset is found exactly.
inline constexpr std::size_t kExactItemsMax = 40;
// And the decisions within which it must be found: their number can grow exponentially.
inline constexpr std::size_t kExactDecisionsMax = 10000;

// Disjoint sets that cover all items; each hangs together by links and has no conflict in it. In
// every set the items with the most links within it come first. Deterministic.
//
// Out of each component of links the heaviest subset without a conflict is taken, then that of what
// is left, until nothing is left. It is exact (branch and bound) where no more than
// kExactItemsMax items of a component have conflicts and kExactDecisionsMax are enough, and beyond
// that greedy: again and again the item whose conflicts weigh least against it; or the best that
// was found within these decisions, if that is heavier.
//
// Costs n log n in the links and conflicts, as many times as the sets that a component is taken
// apart into: no more than about the most conflicts of an item.
std::vector<std::vector<std::uint32_t>> ConsistentSets(const ConsistencyGraph& graph);

}  // namespace loci
