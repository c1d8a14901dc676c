// SPDX-License-Identifier: Apache-2.0
#include "core/graph/ring_order.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace loci {
namespace {

// Once all of a ring are eliminated, the variables further in that one connected part of it touches
// are a clique, in whatever order that was done. So rings are ordered one by one.
class RingOrder {
 public:
  RingOrder(const VariableGraph& graph, std::span<const std::uint32_t> ring) : ring_(ring) {
    const std::uint32_t count = ring.empty() ? 0 : 1 + *std::max_element(ring.begin(), ring.end());
    members_.resize(count);
    cliques_.resize(count);
    number_.resize(graph.count);
    for (std::uint32_t variable = 0; variable < graph.count; ++variable) {
      number_[variable] = static_cast<std::uint32_t>(members_[ring[variable]].size());
      members_[ring[variable]].push_back(variable);
    }
    for (const auto& [a, b] : graph.edges) {
      AddClique({a, b});
    }
    for (const std::vector<std::uint32_t>& clique : graph.cliques) {
      AddClique(clique);
    }
    order_.reserve(graph.count);
    added_by_.assign(graph.count, 0);
  }

  std::vector<std::uint32_t> Find() {
    for (std::size_t ring = members_.size(); ring-- > 0;) {
      OrderRing(static_cast<std::uint32_t>(ring));
      LeaveCliques(static_cast<std::uint32_t>(ring));
    }
    return std::move(order_);
  }

 private:
  using Clique = std::vector<std::uint32_t>;

  // With the outermost of its variables it is dealt with.
  void AddClique(Clique clique) {
    std::uint32_t outermost = 0;
    for (const std::uint32_t variable : clique) {
      outermost = std::max(outermost, ring_[variable]);
    }
    cliques_[outermost].push_back(std::move(clique));
  }

  void OrderRing(std::uint32_t ring) {
    VariableGraph inner;
    inner.count = static_cast<std::uint32_t>(members_[ring].size());
    for (const Clique& clique : cliques_[ring]) {
      Clique part;
      for (const std::uint32_t variable : clique) {
        if (ring_[variable] == ring) {
          part.push_back(number_[variable]);
        }
      }
      if (part.size() == 2) {
        inner.edges.emplace_back(part.front(), part.back());
      } else if (part.size() > 2) {
        inner.cliques.push_back(std::move(part));
      }
    }
    for (const std::uint32_t number : EliminationOrder(inner, {})) {
      order_.push_back(members_[ring][number]);
    }
  }

  // What the ring's elimination leaves to those further in.
  void LeaveCliques(std::uint32_t ring) {
    parent_.resize(members_[ring].size());
    std::iota(parent_.begin(), parent_.end(), 0U);
    std::vector<std::uint32_t> first_of;  // per clique: the number of its first member
    for (const Clique& clique : cliques_[ring]) {
      const auto first = std::find_if(clique.begin(), clique.end(), [&](std::uint32_t variable) {
        return ring_[variable] == ring;
      });
      first_of.push_back(number_[*first]);
      for (const std::uint32_t variable : clique) {
        if (ring_[variable] == ring) {
          Join(number_[*first], number_[variable]);
        }
      }
    }
    std::vector<std::vector<std::uint32_t>> cliques_of(
        members_[ring].size());  // of connected parts
    for (std::uint32_t i = 0; i < first_of.size(); ++i) {
      cliques_of[RootOf(first_of[i])].push_back(i);
    }
    for (const std::vector<std::uint32_t>& part : cliques_of) {
      Clique left;
      ++part_;
      for (const std::uint32_t index : part) {
        for (const std::uint32_t variable : cliques_[ring][index]) {
          if (ring_[variable] != ring && added_by_[variable] != part_) {
            added_by_[variable] = part_;
            left.push_back(variable);
          }
        }
      }
      if (left.size() > 1) {
        AddClique(std::move(left));
      }
    }
    cliques_[ring].clear();
  }

  std::uint32_t RootOf(std::uint32_t number) {
    while (parent_[number] != number) {
      parent_[number] = parent_[parent_[number]];
      number = parent_[number];
    }
    return number;
  }
  void Join(std::uint32_t a, std::uint32_t b) { parent_[RootOf(a)] = RootOf(b); }

  std::span<const std::uint32_t> ring_;
  std::vector<std::vector<std::uint32_t>> members_;  // per ring
  std::vector<std::vector<Clique>> cliques_;         // per ring: edges too
  std::vector<std::uint32_t> number_;                // per variable: among those of its ring
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> parent_;    // of the ring's members: union-find of connected parts
  std::vector<std::uint32_t> added_by_;  // per variable: the last part that has seen it
  std::uint32_t part_ = 0;
};

}  // namespace

std::vector<std::uint32_t> OrderByRings(const VariableGraph& graph,
                                        std::span<const std::uint32_t> ring) {
  return RingOrder(graph, ring).Find();
}

}  // namespace loci
