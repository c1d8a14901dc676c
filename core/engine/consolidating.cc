// SPDX-License-Identifier: Apache-2.0
// Consolidation: a finished place's grids go into the mesh, once (design.md, section 4.11).
#include <algorithm>
#include <cmath>

#include "core/engine/state.h"

namespace loci {
namespace {

constexpr std::uint32_t kLaterPlacesMin = 5;  // of the same session, finished; condition (b)
// Condition (a), HYMM's "highly correlated": a place that has no direct constraint with the host of
// a vertex must be this certain about where it is relative to it.
constexpr double kTiedSigmaM = 0.1;
constexpr double kTiedSigmaRad = 0.03;

// Places that follow each other are tied by hand-over: each begins with what the one before saw. A
// host of the same session within this many places is tied, even where a corridor leaves the
// distance along it open: what is open there is open for all of them together.
constexpr std::uint32_t kTiedBySequence = 6;

bool HasSettled(const Place& place, const Engine::State& state) {
  const SessionState& session = state.sessions[place.session.value];
  if (!session.open) {
    return true;
  }
  std::uint32_t later = 0;
  for (std::size_t i = place.id.value + 1; i < state.places.size(); ++i) {
    later += (state.places[i].session == place.session && state.places[i].finished) ? 1U : 0U;
  }
  return later >= kLaterPlacesMin;
}

bool HasProvisionalClosure(const Place& place, const Engine::State& state) {
  return std::any_of(
      state.closures.begin(), state.closures.end(), [&](const ClosureSnapshot& closure) {
        return closure.state == ClosureState::kProvisional &&
               (closure.from == place.id || closure.to == place.id);
      });
}

bool HasDirectConstraint(PlaceId a, PlaceId b, const Engine::State& state) {
  return std::any_of(state.graph.graph().constraints.begin(),
                     state.graph.graph().constraints.end(),
                     [&](const GraphConstraint& constraint) {
                       return (constraint.from == a.value && constraint.to == b.value) ||
                              (constraint.from == b.value && constraint.to == a.value);
                     });
}

bool IsTiedBySequence(const Place& host, const Place& place) {
  const std::uint32_t apart =
      host.number > place.number ? host.number - place.number : place.number - host.number;
  return host.session == place.session && apart <= kTiedBySequence;
}

// Condition (a): tied to the host of every vertex under the footprint.
bool IsTied(const Place& place, const Engine::State& state) {
  const std::vector<PlaceId> hosts =
      state.mesh->HostsUnder(place.stationary, state.graph.map_from_place(place.id));
  for (const PlaceId host : hosts) {
    if (IsTiedBySequence(state.places[host.value], place) ||
        HasDirectConstraint(host, place.id, state)) {
      continue;
    }
    const Eigen::Matrix3d relative = state.graph.RelativeCovariance(host, place.id);
    if (relative.topLeftCorner<2, 2>().trace() > 2.0 * kTiedSigmaM * kTiedSigmaM ||
        relative(2, 2) > kTiedSigmaRad * kTiedSigmaRad) {
      return false;
    }
  }
  return true;
}

void ConsolidateIfReady(PlaceId id, Engine::State& state) {
  Place& place = state.places[id.value];
  const bool ready = place.finished && !place.consolidated && HasSettled(place, state) &&
                     !HasProvisionalClosure(place, state) && IsTied(place, state);
  if (!ready) {
    return;
  }
  state.mesh->Consolidate({id,
                           place.session,
                           place.last_stamp_ns,
                           &place.stationary,
                           &place.moving,
                           state.graph.map_from_place(id)});
  place.stationary = LogOddsGrid();
  place.moving = LogOddsGrid();
  place.consolidated = true;
  place.changed_by = state.last_event;
}

}  // namespace

void QueueConsolidation(Engine::State& state) {
  state.consolidation_queue.clear();
  for (auto place = state.places.rbegin(); place != state.places.rend(); ++place) {
    if (place->finished && !place->consolidated) {
      state.consolidation_queue.push_back(place->id);
    }
  }
}

void WorkOnMesh(std::uint32_t units, Engine::State& state) {
  for (; units > 0 && HasMeshWork(state); --units) {
    if (!state.consolidation_queue.empty()) {
      const PlaceId next = state.consolidation_queue.back();
      state.consolidation_queue.pop_back();
      ConsolidateIfReady(next, state);
    } else {
      state.mesh->Work(1);
    }
  }
}

bool HasMeshWork(const Engine::State& state) {
  return !state.consolidation_queue.empty() || state.mesh->HasWork();
}

}  // namespace loci
