// SPDX-License-Identifier: Apache-2.0
// Maximum independent sets of the conflicts, component by component of the links.
#include "core/graph/consistent_set.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <set>

namespace loci {
namespace {

using Items = std::vector<std::uint32_t>;

// The neighbours of every item, in rising order, without duplicates.
std::vector<Items> NeighboursOf(std::size_t count,
                                const std::vector<std::pair<std::uint32_t, std::uint32_t>>& pairs) {
  std::vector<Items> neighbours(count);
  for (const auto& [a, b] : pairs) {
    neighbours[a].push_back(b);
    neighbours[b].push_back(a);
  }
  for (Items& each : neighbours) {
    std::sort(each.begin(), each.end());
    each.erase(std::unique(each.begin(), each.end()), each.end());
  }
  return neighbours;
}

// What hangs together by links among `items`, each component and all of them by their lowest item.
std::vector<Items> Components(const std::vector<Items>& links,
                              const Items& items,
                              std::vector<bool>& open) {
  for (const std::uint32_t item : items) {
    open[item] = true;
  }
  std::vector<Items> components;
  for (const std::uint32_t first : items) {
    if (!open[first]) {
      continue;
    }
    open[first] = false;
    Items component = {first};
    for (std::size_t i = 0; i < component.size(); ++i) {
      for (const std::uint32_t next : links[component[i]]) {
        if (open[next]) {
          open[next] = false;
          component.push_back(next);
        }
      }
    }
    std::sort(component.begin(), component.end());
    components.push_back(std::move(component));
  }
  return components;
}

// The heaviest subset of some items without a conflict.
class HeaviestSubset {
 public:
  HeaviestSubset(const std::vector<double>& weights, const std::vector<Items>& conflicts)
      : weights_(weights),
        conflicts_(conflicts),
        free_(weights.size()),
        taken_(weights.size()),
        against_(weights.size()) {}

  Items Find(const Items& items) {
    for (const std::uint32_t item : items) {
      free_[item] = true;
      taken_[item] = false;
    }
    Items contested;
    for (const std::uint32_t item : items) {
      if (Degree(item) == 0) {
        taken_[item] = true;
      } else {
        contested.push_back(item);
      }
    }
    for (const std::uint32_t item :
         contested.size() <= kExactItemsMax ? FindExact(contested) : FindGreedy(contested)) {
      taken_[item] = true;
    }
    Items result;
    for (const std::uint32_t item : items) {
      free_[item] = false;
      if (taken_[item]) {
        result.push_back(item);
      }
    }
    return result;
  }

 private:
  std::size_t Degree(std::uint32_t item) const {
    return static_cast<std::size_t>(
        std::count_if(conflicts_[item].begin(), conflicts_[item].end(), [&](std::uint32_t other) {
          return free_[other];
        }));
  }
  double ConflictWeight(std::uint32_t item) const {
    double sum = 0.0;
    for (const std::uint32_t other : conflicts_[item]) {
      sum += free_[other] ? weights_[other] : 0.0;
    }
    return sum;
  }

  Items FindExact(const Items& contested) {
    chosen_.clear();
    best_.clear();
    best_weight_ = 0.0;
    decisions_left_ = kExactDecisionsMax;
    Branch(contested, 0.0);
    if (decisions_left_ > 0) {
      return best_;
    }
    Items greedy = FindGreedy(contested);
    return WeightOf(greedy) < best_weight_ ? best_ : greedy;
  }

  double WeightOf(const Items& items) const {
    double sum = 0.0;
    for (const std::uint32_t item : items) {
      sum += weights_[item];
    }
    return sum;
  }

  // Decides the item with the most conflicts: with it, its conflicts go; or without it. What is
  // left without a conflict is taken.
  void Branch(const Items& contested, double weight) {
    if (decisions_left_ == 0) {
      return;
    }
    --decisions_left_;
    double rest = 0.0;
    std::uint32_t most = 0;
    std::size_t most_degree = 0;
    for (const std::uint32_t item : contested) {
      if (free_[item]) {
        rest += weights_[item];
        if (const std::size_t degree = Degree(item); degree > most_degree) {
          most = item;
          most_degree = degree;
        }
      }
    }
    if (weight + rest <= best_weight_) {
      return;
    }
    if (most_degree == 0) {
      best_ = chosen_;
      std::copy_if(contested.begin(), contested.end(), std::back_inserter(best_), [&](auto item) {
        return free_[item];
      });
      best_weight_ = weight + rest;
      return;
    }
    Items removed = {most};
    for (const std::uint32_t other : conflicts_[most]) {
      if (free_[other]) {
        removed.push_back(other);
      }
    }
    SetFree(removed, false);
    chosen_.push_back(most);
    Branch(contested, weight + weights_[most]);
    chosen_.pop_back();
    SetFree(removed, true);
    SetFree({most}, false);
    Branch(contested, weight);
    SetFree({most}, true);
  }

  Items FindGreedy(const Items& contested) {
    std::set<std::pair<double, std::uint32_t>> open;  // by what speaks against them
    for (const std::uint32_t item : contested) {
      against_[item] = ConflictWeight(item);
      open.emplace(against_[item] / weights_[item], item);
    }
    Items result;
    while (!open.empty()) {
      const std::uint32_t best = open.begin()->second;
      result.push_back(best);
      open.erase(open.begin());
      free_[best] = false;
      for (const std::uint32_t refused : conflicts_[best]) {
        if (!free_[refused]) {
          continue;
        }
        free_[refused] = false;
        open.erase({against_[refused] / weights_[refused], refused});
        for (const std::uint32_t relieved : conflicts_[refused]) {
          if (free_[relieved]) {
            const auto place = open.find({against_[relieved] / weights_[relieved], relieved});
            against_[relieved] -= weights_[refused];
            auto node = open.extract(place);
            node.value().first = against_[relieved] / weights_[relieved];
            open.insert(std::move(node));
          }
        }
      }
    }
    return result;
  }

  void SetFree(const Items& items, bool is_free) {
    for (const std::uint32_t item : items) {
      free_[item] = is_free;
    }
  }

  const std::vector<double>& weights_;
  const std::vector<Items>& conflicts_;
  std::vector<bool> free_;  // of the items at hand: not decided
  std::vector<bool> taken_;
  Items chosen_;
  Items best_;
  double best_weight_ = 0.0;
  std::size_t decisions_left_ = 0;
  std::vector<double> against_;  // FindGreedy: the weight of the conflicts that are still free
};

// Puts the items with the most links within `set` first.
void SortByLinks(const std::vector<Items>& links, Items& set) {
  std::vector<std::pair<std::size_t, std::uint32_t>> keyed;
  for (const std::uint32_t item : set) {
    const auto inside =
        std::count_if(links[item].begin(), links[item].end(), [&](std::uint32_t other) {
          return std::binary_search(set.begin(), set.end(), other);
        });
    keyed.emplace_back(set.size() - static_cast<std::size_t>(inside), item);
  }
  std::sort(keyed.begin(), keyed.end());
  std::transform(
      keyed.begin(), keyed.end(), set.begin(), [](const auto& each) { return each.second; });
}

}  // namespace

std::vector<std::vector<std::uint32_t>> ConsistentSets(const ConsistencyGraph& graph) {
  const std::size_t count = graph.weights.size();
  const std::vector<Items> links = NeighboursOf(count, graph.links);
  const std::vector<Items> conflicts = NeighboursOf(count, graph.conflicts);
  HeaviestSubset heaviest(graph.weights, conflicts);
  std::vector<bool> open(count);
  Items all(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    all[i] = i;
  }
  std::vector<Items> work = Components(links, all, open);
  std::vector<Items> sets;
  for (std::size_t i = 0; i < work.size(); ++i) {
    const Items component = work[i];
    const Items subset = heaviest.Find(component);
    for (Items& piece : Components(links, subset, open)) {
      SortByLinks(links, piece);
      sets.push_back(std::move(piece));
    }
    Items rest;
    std::set_difference(
        component.begin(), component.end(), subset.begin(), subset.end(), std::back_inserter(rest));
    for (Items& left : Components(links, rest, open)) {
      work.push_back(std::move(left));
    }
  }
  return sets;
}

}  // namespace loci
