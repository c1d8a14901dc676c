// SPDX-License-Identifier: Apache-2.0
// Which constraints and nodes are worked on.
#include "core/graph/toro_optimizer.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace loci {
namespace {

// A learning rate below this moves nothing worth the work: the constraint rests.
constexpr double kRateMin = 1e-3;
// In an update settling does better than sweeps below this rate, to which 1 decays in ten sweeps.
// Fewer sweeps, down to three, leave larger closures half open for some updates.
constexpr double kUpdateRateMin = 0.1;
// Rounds of settling in an update, and nodes in a round: its bounds, of milliseconds. Public graphs
// of 10^4 nodes reach the second one only in their largest closures.
constexpr int kUpdateRounds = 3;
constexpr std::size_t kRoundNodesMax = 2000;

}  // namespace

ToroOptimizer::ToroOptimizer(const PoseGraph& graph) : forest_(graph) {
  patch_index_.assign(forest_.nodes().size(), kAbsent);
  is_unsettled_.assign(forest_.nodes().size(), false);
  rates_.assign(forest_.edges().size(), 0.0);
  is_active_.assign(forest_.edges().size(), false);
  for (std::uint32_t edge = 0; edge < rates_.size(); ++edge) {
    rates_[edge] = 1.0;
    Activate(edge);
  }
}

std::uint32_t ToroOptimizer::AddNode(const Pose2& map_from_node, bool fixed) {
  patch_index_.push_back(kAbsent);
  is_unsettled_.push_back(false);
  return forest_.AddNode(map_from_node, fixed);
}

void ToroOptimizer::AddConstraint(const GraphConstraint& constraint) {
  const bool closes_loop = forest_.AddEdge(constraint);
  const auto edge = static_cast<std::uint32_t>(rates_.size());
  patch_holds_active_ = false;
  rates_.push_back(0.0);  // it fits as it hangs
  is_active_.push_back(false);
  if (closes_loop) {
    RaiseRates(edge);
  }
}

void ToroOptimizer::RaiseRates(std::uint32_t edge) {
  forest_.FindPath(forest_.edges()[edge].ends, path_);
  double compliance = 0.0;
  for (const std::vector<std::uint32_t>* half : {&path_.from_half, &path_.to_half}) {
    for (const std::uint32_t node : *half) {
      const double stiffness = forest_.nodes()[node].stiffness.translation;
      compliance += stiffness > 0.0 ? 1.0 / stiffness : 0.0;
    }
  }
  const double strength = forest_.edges()[edge].weights.translation * compliance;
  const double rate = strength / (1.0 + strength);
  for (const std::vector<std::uint32_t>* half : {&path_.from_half, &path_.to_half}) {
    for (const std::uint32_t node : *half) {
      for (const std::uint32_t other : forest_.nodes()[node].through) {
        rates_[other] = std::max(rates_[other], rate);
        Activate(other);
      }
    }
  }
  rates_[edge] = 1.0;
  Activate(edge);
}

void ToroOptimizer::Activate(std::uint32_t edge) {
  if (!is_active_[edge]) {
    is_active_[edge] = true;
    active_.push_back(edge);
    patch_holds_active_ = false;
  }
}

// Sets to rest whose rate is below. The patch may hold them on: it leaves out who has no rate.
void ToroOptimizer::Rest(double rate_min) {
  std::erase_if(active_, [&](std::uint32_t edge) {
    if (rates_[edge] >= rate_min) {
      return false;
    }
    rates_[edge] = 0.0;
    is_active_[edge] = false;
    return true;
  });
}

std::size_t ToroOptimizer::Sweep() {
  Rest(kRateMin);
  if (active_.empty()) {
    return 0;
  }
  SweepPatch();
  return active_.size();
}

void ToroOptimizer::SweepPatch() {
  if (!patch_holds_active_) {
    BuildSweepPatch();
  }
  for (std::size_t i = 0; i < patch_rates_.size(); ++i) {
    patch_rates_[i] = rates_[patch_.label(i)];
  }
  patch_.Sweep(patch_rates_);
  for (std::uint32_t i = 0; i < patch_nodes_.size(); ++i) {
    if (patch_.Moves(i)) {
      forest_.SetPose(patch_nodes_[i], patch_.ParentFromNode(i));
    }
  }
  for (const std::uint32_t edge : active_) {
    rates_[edge] /= 1.0 + rates_[edge];
  }
}

// Constraints nearest to the root come first (RSS 2007): what they move, they move as a whole.
void ToroOptimizer::BuildSweepPatch() {
  ClearPatch();
  if (2 * active_.size() > forest_.edges().size()) {
    for (const std::uint32_t node : forest_.TreeOrder()) {
      PatchNode(node);  // neighbours in the tree become neighbours in memory
    }
  }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> order;  // top depth, edge
  order.reserve(active_.size());
  for (const std::uint32_t edge : active_) {
    forest_.FindPath(forest_.edges()[edge].ends, path_);
    order.emplace_back(path_.top_depth, edge);
  }
  std::sort(order.begin(), order.end());
  for (const auto& [top_depth, edge] : order) {
    AddPatchConstraint(edge);
  }
  patch_rates_.resize(patch_.constraint_count());
  patch_holds_active_ = true;
}

void ToroOptimizer::ClearPatch() {
  for (const std::uint32_t node : patch_nodes_) {
    patch_index_[node] = kAbsent;
  }
  patch_nodes_.clear();
  has_stiffness_.clear();
  patch_.Clear();
  patch_holds_active_ = false;
}

void ToroOptimizer::AddPatchConstraint(std::uint32_t edge) {
  const ToroForest::Edge& added = forest_.edges()[edge];
  forest_.FindPath(added.ends, path_);
  const std::uint32_t from = PatchNode(added.ends.from);
  for (std::vector<std::uint32_t>* half : {&path_.from_half, &path_.to_half}) {
    for (std::uint32_t& node : *half) {
      const std::uint32_t index = PatchNode(node);
      if (!has_stiffness_[index] && !forest_.nodes()[node].IsRoot()) {
        has_stiffness_[index] = true;
        patch_.SetStiffness(index, forest_.nodes()[node].stiffness);
      }
      node = index;
    }
  }
  patch_.AddConstraint(added, from, path_, edge);
}

// The node's index in the patch; adds it, and those above it that are missing.
std::uint32_t ToroOptimizer::PatchNode(std::uint32_t node) {
  climbed_.clear();
  for (; node != ToroTree::kNone && patch_index_[node] == kAbsent;
       node = forest_.nodes()[node].parent) {
    climbed_.push_back(node);
  }
  std::uint32_t index = node == ToroTree::kNone ? ToroPatch::kNone : patch_index_[node];
  for (; !climbed_.empty(); climbed_.pop_back()) {
    node = climbed_.back();
    index = patch_.AddNode(index, forest_.nodes()[node].parent_from_node);
    patch_index_[node] = index;
    patch_nodes_.push_back(node);
    has_stiffness_.push_back(false);
  }
  return index;
}

std::size_t ToroOptimizer::Update() {
  Rest(kUpdateRateMin);
  while (!active_.empty()) {
    SweepPatch();
    for (std::uint32_t i = 0; i < patch_nodes_.size(); ++i) {
      if (patch_.Moves(i)) {
        MarkUnsettled(patch_nodes_[i]);
      }
    }
    Rest(kUpdateRateMin);
  }
  for (int round = 0; round < kUpdateRounds && !unsettled_.empty(); ++round) {
    SettleRound();
  }
  return unsettled_.size();
}

void ToroOptimizer::MarkUnsettled(std::uint32_t node) {
  if (!is_unsettled_[node] && !forest_.nodes()[node].IsRoot()) {
    is_unsettled_[node] = true;
    unsettled_.push_back(node);
  }
}

// Settles those that wait, nearest to the root first.
void ToroOptimizer::SettleRound() {
  const auto& nodes = forest_.nodes();
  std::sort(unsettled_.begin(), unsettled_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tie(nodes[a].depth, a) < std::tie(nodes[b].depth, b);
  });
  ClearPatch();
  const std::size_t count = std::min(kRoundNodesMax, unsettled_.size());
  edges_at_hand_.clear();
  is_in_patch_.resize(forest_.edges().size(), false);
  settling_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    is_unsettled_[unsettled_[i]] = false;
    settling_.push_back(PatchNode(unsettled_[i]));
    for (const std::uint32_t edge : nodes[unsettled_[i]].through) {
      if (!is_in_patch_[edge]) {
        is_in_patch_[edge] = true;
        edges_at_hand_.push_back(edge);
      }
    }
  }
  unsettled_.erase(unsettled_.begin(), unsettled_.begin() + static_cast<std::ptrdiff_t>(count));
  for (const std::uint32_t edge : edges_at_hand_) {
    is_in_patch_[edge] = false;
    AddPatchConstraint(edge);
  }
  disturbed_.clear();
  patch_.Settle(settling_, ToroPatch::SettleOptions{}, disturbed_);
  for (const std::uint32_t index : settling_) {
    forest_.SetPose(patch_nodes_[index], patch_.ParentFromNode(index));
  }
  for (const std::uint32_t index : disturbed_) {
    MarkUnsettled(patch_nodes_[index]);
  }
}

}  // namespace loci
