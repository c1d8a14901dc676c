// SPDX-License-Identifier: Apache-2.0
// Loop closing: candidates, acceptance, optimisation (design.md, sections 4.9 and 4.10).
#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "core/base/random.h"
#include "core/closure/consistency.h"
#include "core/engine/state.h"

namespace loci {
namespace {

constexpr double kLargeCorrectionM = 1.0;  // test 5
constexpr double kWitnessDistanceM = 3.0;  // test 5: "from another place at least 3 m away"
constexpr std::uint64_t kStageClosure = 2;

// Beyond these a place counts as moved, for those who watch.
constexpr double kMovedM = 1e-3;
constexpr double kMovedRad = 1e-3;

Pose2 RelativePose(const Engine::State& state, PlaceId from, PlaceId to) {
  return Inverse(state.graph.map_from_place(from)) * state.graph.map_from_place(to);
}

UncertainPose2 RelativeEstimate(const Engine::State& state, PlaceId from, PlaceId to) {
  return {RelativePose(state, from, to), state.graph.RelativeCovariance(from, to)};
}

UncertainPose2 MeasurementOf(const ClosureSnapshot& closure) {
  return {closure.from_from_to, closure.covariance};
}

// Test 5, second half: does `other` say the same as `closure`, by way of the graph between their
// ends? In a loop of four, the covariances of the two short sides count too.
bool Agree(const Engine::State& state,
           const ClosureSnapshot& closure,
           const ClosureSnapshot& other) {
  if (RelativePose(state, closure.to, other.to).translation().norm() < kWitnessDistanceM ||
      closure.to == other.to || !state.graph.is_determined()) {
    return false;
  }
  const UncertainPose2 predicted =
      Compose(Compose(RelativeEstimate(state, other.from, closure.from), MeasurementOf(closure)),
              RelativeEstimate(state, closure.to, other.to));
  return Chi2Between(predicted, MeasurementOf(other)) <= kChi2At99;
}

// Whether the closure moves the map further than what the graph believes possible, or than a metre.
bool IsLargeCorrection(const Engine::State& state, const ClosureSnapshot& closure) {
  if (closure.correction_m > kLargeCorrectionM || !state.graph.is_determined()) {
    return true;
  }
  const UncertainPose2 estimate = RelativeEstimate(state, closure.from, closure.to);
  return Chi2Between(estimate, MeasurementOf(closure)) > kChi2At3Sigma;
}

double CorrectionM(const Engine::State& state, const ClosureSnapshot& closure) {
  return (Inverse(RelativePose(state, closure.from, closure.to)) * closure.from_from_to)
      .translation()
      .norm();
}

MapConstraint ConstraintOf(const ClosureSnapshot& closure) {
  const Eigen::Matrix3d information = closure.covariance.inverse();
  return {{closure.from.value,
           closure.to.value,
           closure.from_from_to,
           0.5 * (information + information.transpose()),
           true},
          closure.id};
}

// Test 6: takes the closure that fits worst out of the graph, if it fits worse than chance allows.
bool RejectWorst(Engine::State& state) {
  ClosureId worst;
  double worst_chi2 = kChi2At999;
  for (std::size_t i = 0; i < state.graph.closures().size(); ++i) {
    const std::optional<ClosureId> closure = state.graph.closures()[i];
    if (!closure.has_value()) {
      continue;
    }
    const double chi2 = state.graph.chi2s()[i];
    state.closures[closure->value].chi2 = chi2;
    if (chi2 > worst_chi2) {
      worst_chi2 = chi2;
      worst = *closure;
    }
  }
  if (worst_chi2 <= kChi2At999) {
    return false;
  }
  ClosureSnapshot& closure = state.closures[worst.value];
  closure.state = ClosureState::kRejected;
  closure.reason = "does not fit the optimised graph";
  state.graph.RemoveClosure(worst);
  return true;
}

// Accepts what tests 5 lets pass; returns true if anything was accepted.
bool AcceptProvisional(Engine::State& state) {
  std::vector<ClosureId> accepted;
  for (ClosureSnapshot& closure : state.closures) {
    if (closure.state != ClosureState::kProvisional) {
      continue;
    }
    closure.correction_m = CorrectionM(state, closure);
    if (!IsLargeCorrection(state, closure)) {
      accepted.push_back(closure.id);
      continue;
    }
    for (const ClosureSnapshot& other : state.closures) {
      if (other.id < closure.id && other.state == ClosureState::kProvisional &&
          Agree(state, closure, other)) {
        accepted.push_back(closure.id);
        accepted.push_back(other.id);
      }
    }
  }
  std::vector<MapConstraint> constraints;
  for (const ClosureId id : accepted) {
    ClosureSnapshot& closure = state.closures[id.value];
    if (closure.state == ClosureState::kProvisional) {
      closure.state = ClosureState::kAccepted;
      closure.reason.clear();
      constraints.push_back(ConstraintOf(closure));
    }
  }
  if (!constraints.empty()) {
    state.graph.AddClosures(std::move(constraints));
  }
  return !accepted.empty();
}

// Cells that the dense map has ever written.
std::uint64_t CellsWrittenSoFar(const Engine::State& state) {
  return state.cells_integrated + state.mesh->cells_consolidated() + state.mesh->cells_remeshed();
}

// Places that are no longer where they were.
std::uint32_t CountMoved(const std::vector<Pose2>& before, const std::vector<Pose2>& after) {
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (before[i] == after[i]) {
      continue;
    }
    const Pose2 step = Inverse(before[i]) * after[i];
    count += step.translation().norm() > kMovedM || std::abs(step.theta) > kMovedRad ? 1U : 0U;
  }
  return count;
}

// All candidates of a place have been looked at: decides about what was found. Returns true if the
// graph moved.
bool FinishBatch(ClosureBatch& batch, Engine::State& state) {
  if (batch.found.empty()) {
    return false;
  }
  for (ClosureSnapshot& found : batch.found) {
    found.id = ClosureId{static_cast<std::uint32_t>(state.closures.size())};
    state.closures.push_back(std::move(found));
  }
  state.closures_changed_by = state.last_event;
  state.closures_snapshot.reset();
  const std::uint64_t cells_before = CellsWrittenSoFar(state);
  bool moved = false;
  // What was provisional may be plain once others are in: until nothing more is accepted.
  while (AcceptProvisional(state)) {
    while (RejectWorst(state)) {
    }
    moved = true;
  }
  if (moved) {
    MarkGraphChanged(state);
    state.mesh->MovePlaces(state.graph.map_from_places());
  }
  state.cells_closed += CellsWrittenSoFar(state) - cells_before;
  return moved;
}

void TryCandidate(PlaceId from, ClosureBatch& batch, Engine::State& state) {
  const Place& older = state.places[from.value];
  const Place& newer = state.places[batch.place.value];
  const UncertainPose2 estimate = RelativeEstimate(state, from, batch.place);
  const std::uint64_t seed =
      SeedOf(state.settings, newer.session, MixBits(from.value) ^ batch.place.value, kStageClosure);
  const std::optional<PlaceMatch> match =
      MatchPlaces(older, newer, {estimate.pose, estimate.covariance}, ClosureLimits(), seed);
  if (!match.has_value() || match->agreement.hausdorff_fraction < 0.5) {
    return;  // not alike: nothing worth listing
  }
  ClosureSnapshot closure;
  closure.from = from;
  closure.to = batch.place;
  closure.from_from_to = match->from_from_to;
  closure.covariance = match->covariance.matrix();
  closure.hausdorff_fraction = match->agreement.hausdorff_fraction;
  closure.overlap_m2 = match->agreement.overlap_m2;
  closure.free_conflict_fraction = match->agreement.free_conflict_fraction;
  closure.second_peak_ratio = match->second_peak_ratio;
  closure.reason = match->reason;
  closure.state = match->reason.empty() ? ClosureState::kProvisional : ClosureState::kRejected;
  closure.correction_m = CorrectionM(state, closure);
  if (match->reason.empty()) {
    closure.reason = "waits for a second closure that agrees";
  }
  batch.found.push_back(std::move(closure));
}

}  // namespace

void MarkGraphChanged(Engine::State& state) {
  state.graph_changed_by = state.last_event;
  state.constraints_snapshot.reset();
  if (state.graph_base_count != state.graph.base_count()) {
    state.graph_base_count = state.graph.base_count();
    state.graph_base_changed_by = state.last_event;
  }
}

void BeginClosureBatch(PlaceId place, Engine::State& state) {
  ClosureBatch batch;
  batch.place = place;
  const SessionId session = state.places[place.value].session;
  // Places are compared if each may have looked at where the other begins, within the doubt about
  // that. Further apart they share little, and are tied through those between them.
  const double distance_max_m = state.settings.range_max_m;
  std::vector<std::pair<double, PlaceId>> nearest;
  for (const Place& other : state.places) {
    const bool is_neighbour =
        other.session == session && other.number + 1 == state.places[place.value].number;
    if (!other.finished || other.id >= place || is_neighbour) {
      continue;
    }
    const double distance_m = RelativePose(state, other.id, place).translation().norm();
    if (distance_m > distance_max_m + ClosureLimits().window_max_m) {
      continue;
    }
    const Eigen::Matrix3d doubt = state.graph.RelativeCovariance(other.id, place);
    const double reach_m = std::min(3.0 * std::sqrt(doubt.topLeftCorner<2, 2>().trace()),
                                    ClosureLimits().window_max_m);
    if (distance_m <= distance_max_m + reach_m) {
      nearest.emplace_back(distance_m, other.id);
    }
  }
  std::sort(nearest.begin(), nearest.end());
  for (const auto& [distance_m, id] : nearest) {
    batch.candidates.push_back(id);
  }
  state.sessions[session.value].batches.push_back(std::move(batch));
}

void WorkOnClosures(SessionId session,
                    std::uint32_t units,
                    Engine::State& state,
                    Effects& effects) {
  std::vector<ClosureBatch>& batches = state.sessions[session.value].batches;
  if (batches.empty()) {
    return;
  }
  std::vector<Pose2> poses_before;
  while (!batches.empty() && units > 0) {
    ClosureBatch& batch = batches.front();
    if (batch.next < batch.candidates.size()) {
      TryCandidate(batch.candidates[batch.next], batch, state);
      ++batch.next;
      --units;
    }
    if (batch.next == batch.candidates.size()) {
      if (poses_before.empty() && !batch.found.empty()) {
        poses_before = state.graph.map_from_places();
      }
      effects.closure_accepted = FinishBatch(batch, state) || effects.closure_accepted;
      batches.erase(batches.begin());
    }
  }
  effects.places_moved = CountMoved(poses_before, state.graph.map_from_places());
}

}  // namespace loci
