// SPDX-License-Identifier: Apache-2.0
#include "core/engine/map_graph.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <tuple>

#include "core/base/check.h"
#include "core/graph/optimize.h"

namespace loci {
namespace {

// After so many the present graph becomes the base: a map is read from its records in the time of
// so many steps, and what linearisation leaves does not add up.
constexpr std::size_t kStepsMax = 256;

// A step may raise the cost by what linearisation neglects.
constexpr double kCostSlack = 1e-2;
constexpr double kRelativeCostSlack = 1e-3;

IncrementalOptions OptionsOfSteps() {
  IncrementalOptions options;
  options.kernel = MapGraph::ClosureKernel();
  options.iterations_max = 30;  // each step ends at the optimum, however far that is
  options.step_min = 1e-4;      // m: a hundredth of what a match knows at best
  return options;
}

bool IsBefore(const MapConstraint& a, const MapConstraint& b) {
  return std::tie(a.constraint.from, a.constraint.to, a.closure) <
         std::tie(b.constraint.from, b.constraint.to, b.closure);
}

// Further than any map reaches.
constexpr double kUnknownM = 1e5;

bool AreFinite(const std::vector<Pose2>& poses) {
  return std::all_of(
      poses.begin(), poses.end(), [](const Pose2& pose) { return pose.vector().allFinite(); });
}

Status MisfitError(const std::string& what) {
  return DataLossError("graph record: " + what);
}

}  // namespace

RobustKernel MapGraph::ClosureKernel() {
  return {RobustKernel::Shape::kCauchy, 3.0};
}

MapGraph::MapGraph() : optimizer_(OptionsOfSteps()) {}

std::size_t MapGraph::closure_count() const {
  return static_cast<std::size_t>(std::count_if(
      closures_.begin(), closures_.end(), [](const auto& closure) { return closure.has_value(); }));
}

void MapGraph::AddPlace(const Pose2& map_from_place, const std::optional<GraphConstraint>& tie) {
  Step step{StepKind::kPlace, map_from_place, {}, {}};
  if (tie.has_value()) {
    step.constraints.push_back({*tie, {}});
  }
  Take(std::move(step));
}

void MapGraph::AddClosures(std::vector<MapConstraint> closures) {
  std::sort(closures.begin(), closures.end(), IsBefore);
  Take({StepKind::kClosures, {}, std::move(closures), {}});
}

void MapGraph::RemoveClosure(ClosureId closure) {
  Take({StepKind::kRemoval, {}, {}, closure});
}

double MapGraph::chi2() const {
  return std::accumulate(chi2s_.begin(), chi2s_.end(), 0.0);
}

// What is robust counts by the kernel.
double MapGraph::Cost() const {
  return std::accumulate(costs_.begin(), costs_.end(), 0.0);
}

void MapGraph::Weigh(std::size_t index) {
  const GraphConstraint& constraint = present_.constraints[index];
  chi2s_[index] = Chi2Of(present_, constraint);
  costs_[index] = constraint.robust ? ClosureKernel().Rho(chi2s_[index]) : chi2s_[index];
}

void MapGraph::Take(Step step) {
  LOCI_CHECK(CheckStep(step).ok());
  Add(step);
  steps_.push_back(std::move(step));
  if (steps_.back().kind == StepKind::kPlace) {
    Update();
    return;
  }
  const std::vector<Pose2> poses_before = present_.map_from_node;
  const double cost_before = Cost();
  const bool converged = Update();
  MovePlaces();
  // Not so if the cost is no number.
  const bool is_good = Cost() <= cost_before * (1.0 + kRelativeCostSlack) + kCostSlack;
  if (!converged || !is_good) {
    present_.map_from_node = poses_before;
    OptimizeOptions options;
    options.sparse.kernel = ClosureKernel();
    LOCI_CHECK(OptimizeGraph(present_, options).ok());
    BeginBase();
  } else if (steps_.size() >= kStepsMax) {
    SparseOptions options;
    options.kernel = ClosureKernel();
    OptimizeSparse(present_, options);
    BeginBase();
  }
}

void MapGraph::Add(const Step& step) {
  if (step.kind == StepKind::kPlace) {
    const bool is_origin = present_.map_from_node.empty();
    optimizer_.AddNode(step.map_from_place, is_origin);
    present_.map_from_node.push_back(step.map_from_place);
    present_.fixed.push_back(is_origin);
  }
  for (const MapConstraint& each : step.constraints) {
    numbers_.push_back(optimizer_.AddConstraint(each.constraint));
    present_.constraints.push_back(each.constraint);
    closures_.push_back(each.closure);
    chi2s_.push_back(0.0);
    costs_.push_back(0.0);
    Weigh(costs_.size() - 1);
  }
  if (step.kind == StepKind::kRemoval) {
    const auto at = std::find(closures_.begin(), closures_.end(), step.removed) - closures_.begin();
    LOCI_CHECK(optimizer_.RemoveConstraint(numbers_[static_cast<std::size_t>(at)]).ok());
    present_.constraints.erase(present_.constraints.begin() + at);
    closures_.erase(closures_.begin() + at);
    numbers_.erase(numbers_.begin() + at);
    chi2s_.erase(chi2s_.begin() + at);
    costs_.erase(costs_.begin() + at);
  }
}

// False: the optimiser is not at the optimum.
bool MapGraph::Update() {
  const bool converged = optimizer_.Update().converged;
  is_determined_ = converged || optimizer_.Factorise();
  return converged;
}

void MapGraph::MovePlaces() {
  std::vector<bool> has_moved(present_.map_from_node.size(), false);
  for (const std::uint32_t node : optimizer_.TakeMovedNodes()) {
    present_.map_from_node[node] = optimizer_.map_from_node(node);
    has_moved[node] = true;
  }
  for (std::size_t i = 0; i < present_.constraints.size(); ++i) {
    if (has_moved[present_.constraints[i].from] || has_moved[present_.constraints[i].to]) {
      Weigh(i);
    }
  }
}

void MapGraph::BeginBase() {
  base_poses_ = present_.map_from_node;
  base_constraints_.clear();
  for (std::size_t i = 0; i < closures_.size(); ++i) {
    base_constraints_.push_back({present_.constraints[i], closures_[i]});
  }
  ++base_count_;
  steps_.clear();
  steps_base_ = base_count_;
  LoadBase();
}

void MapGraph::LoadBase() {
  present_ = {};
  present_.map_from_node = base_poses_;
  present_.fixed.assign(base_poses_.size(), false);
  if (!base_poses_.empty()) {
    present_.fixed.front() = true;
  }
  closures_.clear();
  for (const MapConstraint& each : base_constraints_) {
    present_.constraints.push_back(each.constraint);
    closures_.push_back(each.closure);
  }
  numbers_.resize(closures_.size());
  std::iota(numbers_.begin(), numbers_.end(), 0U);
  chi2s_.resize(closures_.size());
  costs_.resize(closures_.size());
  for (std::size_t i = 0; i < closures_.size(); ++i) {
    Weigh(i);
  }
  optimizer_ = IncrementalOptimizer(OptionsOfSteps());
  optimizer_.Load(present_);
  Update();
  MovePlaces();
  if (!AreFinite(present_.map_from_node)) {  // as rounding may leave what is nearly singular
    present_.map_from_node = base_poses_;
    is_determined_ = false;
  }
}

// Of what was read: the base is a graph of one piece, and what the steps bring is valid by itself.
Status MapGraph::CheckBase() const {
  if (steps_base_ != base_count_) {
    return MisfitError("its steps follow another base");
  }
  PoseGraph tied;  // by other than closures
  PoseGraph all;
  tied.map_from_node = base_poses_;
  all.map_from_node = base_poses_;
  const auto add = [](const MapConstraint& each, PoseGraph& graph) {
    graph.constraints.push_back(each.constraint);
    return each.constraint.robust == each.closure.has_value();
  };
  bool only_closures_are_robust = true;
  for (const MapConstraint& each : base_constraints_) {
    only_closures_are_robust = add(each, all) && only_closures_are_robust;
    if (!each.closure.has_value()) {
      add(each, tied);
    }
  }
  if (const Status valid = ValidateGraph(all); !valid.ok()) {
    return MisfitError(valid.message());
  }
  if (FindComponents(tied).count > 1) {
    return MisfitError("its base is not of one piece");
  }
  for (const Step& step : steps_) {
    if (step.kind == StepKind::kPlace) {
      all.map_from_node.push_back(step.map_from_place);
    }
    for (const MapConstraint& each : step.constraints) {
      only_closures_are_robust = add(each, all) && only_closures_are_robust;
    }
  }
  if (!only_closures_are_robust) {
    return MisfitError("takes a tie for a closure");
  }
  if (const Status valid = ValidateGraph(all); !valid.ok()) {
    return MisfitError(valid.message());
  }
  return {};
}

// Of what has been validated: whether it can be the next step.
Status MapGraph::CheckStep(const Step& step) const {
  const std::size_t places = present_.map_from_node.size();
  const auto names_places_below = [&](std::size_t count) {
    return std::all_of(
        step.constraints.begin(), step.constraints.end(), [&](const MapConstraint& each) {
          return each.constraint.from < count && each.constraint.to < count;
        });
  };
  switch (step.kind) {
    case StepKind::kPlace:
      if (step.constraints.size() == (places == 0 ? 0U : 1U) && names_places_below(places + 1) &&
          (places == 0 || std::max(step.constraints[0].constraint.from,
                                   step.constraints[0].constraint.to) == places)) {
        return {};
      }
      return MisfitError("place " + std::to_string(places) + " is not tied to one before it");
    case StepKind::kClosures:
      return names_places_below(places) &&
                     std::all_of(step.constraints.begin(),
                                 step.constraints.end(),
                                 [](const MapConstraint& each) { return each.closure.has_value(); })
                 ? Status()
                 : MisfitError("a closure names a missing place, or is none");
    case StepKind::kRemoval:
      return std::find(closures_.begin(), closures_.end(), step.removed) != closures_.end()
                 ? Status()
                 : MisfitError("removes a closure that is not there");
  }
  return MisfitError("a step of no known kind");
}

Status MapGraph::Restore() {
  LOCI_RETURN_IF_ERROR(CheckBase());
  LoadBase();
  for (const Step& step : steps_) {
    LOCI_RETURN_IF_ERROR(CheckStep(step));
    Add(step);
    Update();
    if (step.kind != StepKind::kPlace) {
      MovePlaces();
    }
  }
  return AreFinite(present_.map_from_node) ? Status() : MisfitError("leads to no finite poses");
}

Eigen::Matrix3d MapGraph::RelativeCovariance(PlaceId from, PlaceId to) const {
  if (!is_determined_) {
    return Eigen::Vector3d(kUnknownM * kUnknownM, kUnknownM * kUnknownM, kPi * kPi).asDiagonal();
  }
  return optimizer_.RelativeCovariance(from.value, to.value);
}

}  // namespace loci
