// SPDX-License-Identifier: Apache-2.0
#include "core/engine/engine.h"

#include <optional>
#include <utility>

#include "core/base/random.h"
#include "core/engine/state.h"

namespace loci {
namespace {

// Work that one observation does for its session and for the map (design.md, section 3).
constexpr std::uint32_t kClosureUnits = 2;
constexpr std::uint32_t kMeshUnits = 2;
constexpr std::uint64_t kStageHandOver = 1;
constexpr std::uint32_t kNoLimit = 0xFFFFFFFFU;
// How well a session's start is known: a dock, or a place marked on the floor.
constexpr double kStartSigmaM = 0.1;
constexpr double kStartSigmaRad = 0.05;
// A robot that reports no motion may still have crept.
constexpr double kStandingSigma = 0.02;

PlaceSettings PlaceSettingsOf(const MapSettings& settings) {
  return {settings.cell_size_m, settings.place_length_m, settings.range_max_m};
}

Eigen::Matrix3d CovarianceOf(const std::array<double, 6>& upper) {
  Eigen::Matrix3d matrix;
  matrix << upper[0], upper[1], upper[2], upper[1], upper[3], upper[4], upper[2], upper[4],
      upper[5];
  return matrix;
}

// Nothing that a robot says of its motion is taken to be better, nor worse than 100 m and 10 rad:
// next to each other, the graph's equations would be lost in rounding.
constexpr double kTieSigmaMinM = 1e-3;
constexpr double kTieSigmaMinRad = 1e-4;

// Of the next place to an older one.
GraphConstraint TieTo(PlaceId from,
                      const Pose2& from_from_next,
                      const Eigen::Matrix3d& covariance,
                      const Engine::State& state) {
  const auto next = static_cast<std::uint32_t>(state.places.size());
  return {from.value,
          next,
          from_from_next,
          InformationOf(covariance, kTieSigmaMinM, kTieSigmaMinRad),
          false};
}

// The next place, for the session, at a pose in the map that its tie to the graph says. The first
// place of all has no tie.
Place& AddPlace(SessionId session,
                const Pose2& map_from_place,
                const std::optional<GraphConstraint>& tie,
                Engine::State& state) {
  Place& place = state.places.emplace_back();
  place.id = PlaceId{static_cast<std::uint32_t>(state.places.size() - 1)};
  place.session = session;
  place.patch = Patch(state.settings.cell_size_m);
  place.changed_by = state.last_event;
  state.graph.AddPlace(map_from_place, tie);
  MarkGraphChanged(state);
  place.number = state.sessions[session.value].place_count++;
  return place;
}

void FinishPlace(PlaceId id, Engine::State& state) {
  Place& place = state.places[id.value];
  place.finished = true;
  place.coverage = Coverage::OfGrid(place.stationary, state.settings.cell_size_m);
  place.changed_by = state.last_event;
  BeginClosureBatch(id, state);
  QueueConsolidation(state);
}

void StartNextPlace(SessionId id, std::uint64_t number, Engine::State& state) {
  SessionState& session = state.sessions[id.value];
  const PlaceId old_id = session.track.place;
  const Eigen::Matrix3d covariance =
      HandOverCovariance(session.track,
                         state.places[old_id.value],
                         SeedOf(state.settings, id, number, kStageHandOver));
  const Pose2 old_from_next = session.track.place_from_robot;
  const Pose2 map_from_next = state.graph.map_from_place(old_id) * old_from_next;
  Place& next = AddPlace(id, map_from_next, TieTo(old_id, old_from_next, covariance, state), state);
  HandOver(next, session.track);
  state.mesh->MovePlaces(state.graph.map_from_places());
  FinishPlace(old_id, state);
}

void AppendPose(const ObservationEvent& event, Engine::State& state, SessionState& session) {
  session.newest.push_back({event.stamp_ns, session.track.place, session.track.place_from_robot});
  if (session.newest.size() == kPiecePoses) {
    session.pieces.push_back(
        std::make_shared<const TrajectoryPiece>(std::exchange(session.newest, {})));
    session.piece_changed_by.push_back(state.last_event);
    ++session.piece_count;
  }
}

}  // namespace

std::uint64_t SeedOf(const MapSettings& settings,
                     SessionId session,
                     std::uint64_t number,
                     std::uint64_t stage) {
  return MixBits(MixBits(MixBits(settings.seed ^ MixBits(session.value)) ^ number) ^ stage);
}

// Applies one kind of event each; `effects` says what happened.
struct EventApplier {
  Engine::State& state;
  Effects& effects;

  void operator()(const CreateMapEvent& event) {
    LOCI_CHECK(!state.mesh.has_value());
    state.settings = event.settings;
    state.mesh.emplace(event.settings.cell_size_m);
    state.mesh->BeginEvent(state.last_event);
  }

  void operator()(const OpenSessionEvent& event) {
    const SessionId id{static_cast<std::uint32_t>(state.sessions.size())};
    SessionState& session = state.sessions.emplace_back();
    session.session = event.session;
    session.robot = event.robot;
    session.map_from_start = event.map_from_start;
    session.changed_by = state.last_event;
    std::optional<GraphConstraint> tie;
    if (!state.places.empty()) {
      tie = TieTo(PlaceId{0},
                  Inverse(state.graph.map_from_place(PlaceId{0})) * event.map_from_start,
                  Covariance3::FromSigmas(kStartSigmaM, kStartSigmaM, kStartSigmaRad).matrix(),
                  state);
    }
    Place& place = AddPlace(id, event.map_from_start, tie, state);
    session.track.place = place.id;
    session.track.covariance = Covariance3::FromSigmas(0.02, 0.02, 0.01).matrix();
    RebuildCaches(place, session.track);
    state.mesh->MovePlaces(state.graph.map_from_places());
  }

  void operator()(const ObservationEvent& event) {
    SessionState& session = state.sessions[event.session.value];
    LOCI_CHECK(session.open && event.number == session.last_number + 1);
    session.changed_by = state.last_event;
    session.last_number = event.number;
    if (session.accepted_count == 0) {
      session.first_stamp_ns = event.stamp_ns;
    }
    ++session.accepted_count;
    session.last_stamp_ns = event.stamp_ns;
    Follow(event, session);
    if (WantsNewPlace(session.track, PlaceSettingsOf(state.settings))) {
      StartNextPlace(event.session, event.number, state);
      effects.place_finished = true;
    }
    Work(event.session);
  }

  void operator()(const RefuseObservationEvent& event) {
    SessionState& session = state.sessions[event.session.value];
    LOCI_CHECK(session.open && event.number == session.last_number + 1);
    session.changed_by = state.last_event;
    session.last_number = event.number;
    ++session.refused_count;
  }

  void operator()(const CloseSessionEvent& event) {
    SessionState& session = state.sessions[event.session.value];
    LOCI_CHECK(session.open);
    session.changed_by = state.last_event;
    session.open = false;
    FinishPlace(session.track.place, state);
    effects.place_finished = true;
    WorkOnClosures(event.session, kNoLimit, state, effects);
    session.track.recent_keys.clear();
    session.track.likelihood = LikelihoodGrid();
    QueueConsolidation(state);
    while (HasMeshWork(state)) {
      WorkOnMesh(kNoLimit, state);
    }
  }

  void Follow(const ObservationEvent& event, SessionState& session) {
    Eigen::Matrix3d covariance =
        Covariance3::FromSigmas(kStandingSigma, kStandingSigma, kStandingSigma).matrix();
    Pose2 motion;
    if (event.odometry.has_value()) {
      covariance = CovarianceOf(event.odometry->covariance_upper);
      motion = event.odometry->previous_from_robot;
    }
    Predict(motion, covariance, session.track);
    if (event.scan.has_value()) {
      Place& place = state.places[session.track.place.value];
      const Place* previous = session.track.previous.has_value()
                                  ? &state.places[session.track.previous->value]
                                  : nullptr;
      state.cells_integrated +=
          TakeScan(*event.scan, PlaceSettingsOf(state.settings), previous, session.track, place);
      place.last_stamp_ns = event.stamp_ns;
      place.changed_by = state.last_event;
      AppendPose(event, state, session);
    }
  }

  void Work(SessionId session) {
    WorkOnClosures(session, kClosureUnits, state, effects);
    if (effects.closure_accepted) {
      QueueConsolidation(state);
    }
    WorkOnMesh(kMeshUnits, state);
  }
};

Engine::Engine() : state_(std::make_unique<State>()) {}
Engine::~Engine() = default;
Engine::Engine(Engine&&) noexcept = default;
Engine& Engine::operator=(Engine&&) noexcept = default;

Effects Engine::Apply(const Event& event) {
  ++state_->last_event.value;
  if (state_->mesh.has_value()) {
    state_->mesh->BeginEvent(state_->last_event);
  }
  Effects effects;
  std::visit(EventApplier{*state_, effects}, event);
  return effects;
}

EventNumber Engine::last_event() const {
  return state_->last_event;
}

EngineCounts Engine::Counts() const {
  EngineCounts counts;
  counts.sessions = state_->sessions.size();
  counts.places = state_->places.size();
  counts.ltrs = state_->mesh.has_value() ? state_->mesh->LtrCount() : 0;
  counts.closures = state_->graph.closure_count();
  return counts;
}

}  // namespace loci
