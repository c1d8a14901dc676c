// SPDX-License-Identifier: Apache-2.0
// Rounds of believing, optimising and doubting.
#include "core/graph/closure_growth.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <utility>

#include "core/graph/component_join.h"
#include "core/graph/consistent_set.h"
#include "core/graph/graph_selection.h"
#include "core/graph/sparse_optimizer.h"

namespace loci {
namespace {

// A cluster is believed if a false one would fit with at most this probability. Where none is, four
// times as much is tried, up to the last: of a thousand false closures that stand alone, most are
// known much better or not at all, and of a hundred false clusters one or two would pass.
constexpr double kChanceFirst = 1e-3;
constexpr double kChanceLastAlone = 4e-3;
constexpr double kChanceLast = 1.6e-2;
constexpr double kChanceRise = 4.0;
// A cluster whose chance is so much larger than what is looked for is left alone for so many
// rounds, unless nothing else is found: a round changes little for most.
constexpr double kFarOff = 10.0;
constexpr int kFarOffRounds = 4;
// Two clusters are compared if both ends are among so many nodes. Further away too little is known
// for a link, and the covariances along long paths are what costs the time.
constexpr std::size_t kAgreeingNodes = 2000;
// Two clusters that agree by chance with more than this probability do not support each other.
constexpr double kSupportChanceMax = 1e-3;
// Believed closures may exceed the gate by this before they are doubted: the optimum is not reached
// yet.
constexpr double kDoubtFactor = 2.0;
// A cluster that was doubted so often stays out.
constexpr int kDoubtsMax = 3;
constexpr int kRoundsMax = 200;
// A round need not be exact, only right: the next one moves everything again.
constexpr int kIterationsMax = 10;
constexpr double kGainMin = 1e-3;
constexpr double kUnknown = std::numeric_limits<double>::infinity();

class ClosureGrowth {
 public:
  ClosureGrowth(const ClosureClusters& clusters, PoseGraph& graph)
      : clusters_(clusters),
        graph_(graph),
        scale_(clusters.covariance_scale),
        paths_(graph),
        paths_b_(graph),
        states_(clusters.clusters.size()),
        believed_(TrustedOf(graph)),
        touched_(graph.map_from_node.size()) {
    for (const GraphConstraint& constraint : graph.constraints) {
      touched_[constraint.from] = true;
      touched_[constraint.to] = true;
    }
  }

  std::vector<bool> Grow() {
    Optimize();
    GrowFrom(2, kChanceLast);
    GrowFrom(1, kChanceLastAlone);
    return believed_.constraints;
  }

 private:
  struct State {
    bool believed = false;
    int doubts = 0;
    double chi2 = 0.0;         // of its first closure against the graph; scaled
    double chance = kUnknown;  // that a false one would pass; kUnknown: no path joins its ends
    int evaluated_round = -kFarOffRounds;  // of its chi2 and chance
  };

  const Closure& FirstOf(std::size_t cluster) const {
    return clusters_.closures[clusters_.clusters[cluster].front()];
  }
  std::size_t SizeOf(std::size_t cluster) const { return clusters_.clusters[cluster].size(); }
  const GraphConstraint& ConstraintOf(std::uint32_t closure) const {
    return graph_.constraints[clusters_.closures[closure].constraint];
  }
  double Chance(const Discrepancy& discrepancy) const {
    return ChanceOf(discrepancy, scale_, area_m2_);
  }
  Relation RelationTo(const PathCovariance& paths, std::uint32_t from, std::uint32_t to) const {
    return {Inverse(graph_.map_from_node[from]) * graph_.map_from_node[to], paths.CovarianceTo(to)};
  }

  // Believes clusters of at least this size until nothing is left that is certain enough.
  void GrowFrom(std::size_t size_min, double chance_last) {
    double chance_max = kChanceFirst;
    for (int i = 0; i < kRoundsMax && chance_max <= chance_last; ++i) {
      ++round_;
      UseBelieved();
      std::vector<std::size_t> next = Certain(Evaluate(size_min, kFarOff * chance_max), chance_max);
      if (next.empty()) {
        const std::vector<std::size_t> open = Evaluate(size_min, 0.0);
        next = Certain(open, chance_max);
        if (next.empty()) {
          next = Agreeing(open);
        }
      }
      if (next.empty()) {
        chance_max *= kChanceRise;
        continue;
      }
      for (const std::size_t cluster : next) {
        Believe(cluster);
      }
      Optimize();
      if (Doubt()) {
        Optimize();
      }
    }
  }

  void UseBelieved() {
    paths_.Use(believed_.constraints);
    paths_b_.Use(believed_.constraints);
    FindArea();
  }

  // Holds the open clusters against the graph, but for those whose chance was above `far_off` a few
  // rounds ago (0: all). Returns those that fit.
  std::vector<std::size_t> Evaluate(std::size_t size_min, double far_off) {
    std::vector<std::size_t> fitting;
    for (std::size_t i = 0; i < states_.size(); ++i) {
      State& state = states_[i];
      if (state.believed || state.doubts >= kDoubtsMax || SizeOf(i) < size_min ||
          (state.chance > far_off && far_off > 0.0 &&
           state.evaluated_round + kFarOffRounds > round_)) {
        continue;
      }
      if (state.evaluated_round < round_) {
        EvaluateOne(FirstOf(i), state);
      }
      if (state.chi2 <= kGateChi2) {
        fitting.push_back(i);
      }
    }
    return fitting;
  }

  void EvaluateOne(const Closure& closure, State& state) {
    state.evaluated_round = round_;
    paths_.Search(closure.a, PathCovariance::kAllNodes, closure.b);
    if (paths_.IsFound(closure.b)) {
      const Discrepancy discrepancy =
          CompareClosure(closure, RelationTo(paths_, closure.a, closure.b));
      state.chi2 = discrepancy.chi2 / scale_;
      state.chance = Chance(discrepancy);
    } else {
      state.chi2 = 0.0;
      state.chance = kUnknown;
    }
  }

  std::vector<std::size_t> Certain(const std::vector<std::size_t>& open, double chance_max) const {
    std::vector<std::size_t> certain;
    std::copy_if(open.begin(), open.end(), std::back_inserter(certain), [&](std::size_t cluster) {
      return states_[cluster].chance <= chance_max;
    });
    return certain;
  }

  // The heaviest set of at least two clusters that agree with each other.
  std::vector<std::size_t> Agreeing(std::vector<std::size_t> open) {
    std::stable_sort(open.begin(), open.end(), [&](std::size_t x, std::size_t y) {
      return states_[x].chance < states_[y].chance;
    });
    open.resize(std::min(open.size(), kAgreeingMax));
    ConsistencyGraph consistency;
    for (const std::size_t cluster : open) {
      consistency.weights.push_back(static_cast<double>(SizeOf(cluster)));
    }
    for (std::uint32_t i = 0; i < open.size(); ++i) {
      CompareWithLater(open, i, consistency);
    }
    std::vector<std::size_t> best;
    double best_weight = 0.0;
    for (const std::vector<std::uint32_t>& set : ConsistentSets(consistency)) {
      double weight = 0.0;
      for (const std::uint32_t i : set) {
        weight += consistency.weights[i];
      }
      if (set.size() > 1 && weight > best_weight) {
        best.clear();
        for (const std::uint32_t i : set) {
          best.push_back(open[i]);
        }
        best_weight = weight;
      }
    }
    return best;
  }

  void CompareWithLater(const std::vector<std::size_t>& open,
                        std::uint32_t i,
                        ConsistencyGraph& consistency) {
    const Closure& first = FirstOf(open[i]);
    paths_.Search(first.a, kAgreeingNodes);
    paths_b_.Search(first.b, kAgreeingNodes);
    for (std::uint32_t j = i + 1; j < open.size(); ++j) {
      const Closure& second = FirstOf(open[j]);
      if (!paths_.IsFound(second.a) || !paths_b_.IsFound(second.b)) {
        continue;
      }
      const Discrepancy discrepancy = CompareClosures(first,
                                                      second,
                                                      RelationTo(paths_, first.a, second.a),
                                                      RelationTo(paths_b_, first.b, second.b));
      if (discrepancy.chi2 > kGateChi2 * scale_) {
        consistency.conflicts.emplace_back(i, j);
      } else if (Chance(discrepancy) <= kSupportChanceMax) {
        consistency.links.emplace_back(i, j);
      }
    }
  }

  void Believe(std::size_t cluster) {
    if (states_[cluster].chance == kUnknown) {
      const Closure& first = FirstOf(cluster);
      PoseGraph believed = PartOf(graph_, believed_);
      JoinComponents(first.a, first.b, first.a_from_b, believed);
      TakePoses(std::move(believed), graph_);
    }
    states_[cluster].believed = true;
    for (const std::uint32_t closure : clusters_.clusters[cluster]) {
      believed_.constraints[clusters_.closures[closure].constraint] = true;
    }
  }

  void Optimize() {
    SparseOptions options;
    options.iterations_max = kIterationsMax;
    options.relative_gain_min = kGainMin;
    OptimizePart(believed_, options, graph_);
  }

  // A cluster is open again if more than half of it does not fit any more; otherwise only its
  // closures that do not are left out. Returns whether there was any.
  bool Doubt() {
    bool changed = false;
    for (std::size_t i = 0; i < states_.size(); ++i) {
      if (!states_[i].believed) {
        continue;
      }
      const auto is_wrong = [&](std::uint32_t closure) {
        return Chi2Of(graph_, ConstraintOf(closure)) > kDoubtFactor * kGateChi2 * scale_;
      };
      const std::vector<std::uint32_t>& cluster = clusters_.clusters[i];
      const auto wrong = std::count_if(cluster.begin(), cluster.end(), is_wrong);
      const bool all_wrong = 2 * static_cast<std::size_t>(wrong) > cluster.size();
      for (const std::uint32_t closure : cluster) {
        const std::uint32_t constraint = clusters_.closures[closure].constraint;
        if (believed_.constraints[constraint] && (all_wrong || is_wrong(closure))) {
          believed_.constraints[constraint] = false;
          changed = true;
        }
      }
      states_[i].believed = !all_wrong;
      states_[i].doubts += all_wrong ? 1 : 0;
    }
    return changed;
  }

  // Over the nodes that a constraint touches: others are nowhere.
  void FindArea() {
    std::vector<Eigen::Vector2d> positions;
    for (std::size_t i = 0; i < touched_.size(); ++i) {
      if (touched_[i]) {
        positions.push_back(graph_.map_from_node[i].translation());
      }
    }
    area_m2_ = AreaOf(positions);
  }

  const ClosureClusters& clusters_;
  PoseGraph& graph_;
  double scale_;
  double area_m2_ = 0.0;
  int round_ = 0;
  PathCovariance paths_;       // over what is believed
  PathCovariance paths_b_;     // the same, from the other end
  std::vector<State> states_;  // per cluster
  GraphSelection believed_;
  std::vector<bool> touched_;  // per node, by a constraint
};

}  // namespace

std::vector<bool> GrowByClosures(const ClosureClusters& clusters, PoseGraph& graph) {
  if (graph.map_from_node.empty()) {
    return {};
  }
  return ClosureGrowth(clusters, graph).Grow();
}

}  // namespace loci
