// SPDX-License-Identifier: Apache-2.0
// The state as records for checkpoints, and its digest.
#include <algorithm>
#include <string>
#include <utility>

#include "core/engine/state.h"
#include "core/engine/state_fields.h"

namespace loci {
namespace {

// Kinds of records; the mesh has 40 and 41. Those below 100 follow the area of the map, the others
// its history (storage/store.h).
constexpr std::uint32_t kHeaderRecord = 1;
constexpr std::uint32_t kGraphRecord = 2;
constexpr std::uint32_t kPlaceRecord = 3;
constexpr std::uint32_t kGraphStepsRecord = 4;
constexpr std::uint32_t kSessionRecord = 100;
constexpr std::uint32_t kPieceRecord = 101;
constexpr std::uint32_t kClosuresRecord = 102;

std::uint64_t PieceRecordId(std::size_t session, std::size_t piece) {
  return (static_cast<std::uint64_t>(session) << 32U) | piece;
}

template <typename T>
StateRecord RecordOf(std::uint32_t kind, std::uint64_t id, const T& value) {
  BinaryWriter writer;
  writer(value);
  return {kind, id, writer.TakeBytes()};
}

template <typename T>
Status Decode(const StateRecord& record, const char* what, T& value) {
  BinaryReader reader(record.bytes);
  reader(value);
  return reader.Finish(std::string(what) + " record " + std::to_string(record.id));
}

// Records come in any order; those with numbers must be all there.
template <typename T>
T& Slot(std::vector<T>& values, std::uint64_t index) {
  if (values.size() <= index) {
    values.resize(static_cast<std::size_t>(index) + 1);
  }
  return values[static_cast<std::size_t>(index)];
}

constexpr std::uint64_t kIdsMax = 1U << 22U;  // places or sessions of one map; more is damage

// How many records the whole state has. The header says it, so that a lost record is missed.
std::uint64_t RecordCount(const Engine::State& state) {
  std::uint64_t count = 4 + state.places.size() + state.sessions.size();  // 4: the single ones
  for (const SessionState& session : state.sessions) {
    count += session.pieces.size();
  }
  return count + (state.mesh.has_value() ? 1 + state.mesh->LtrCount() : 0);
}

Status ReadHeader(const std::vector<StateRecord>& records, Engine::State& state) {
  for (const StateRecord& record : records) {
    if (record.kind != kHeaderRecord) {
      continue;
    }
    std::uint64_t count = 0;
    BinaryReader reader(record.bytes);
    HeaderFields(reader, state);
    reader(count);
    LOCI_RETURN_IF_ERROR(reader.Finish("header record"));
    if (count != records.size()) {
      return DataLossError("header record: the state has " + std::to_string(count) +
                           " records, not " + std::to_string(records.size()));
    }
    return {};
  }
  return DataLossError("header record: missing");
}

Status ReadRecord(const StateRecord& record, Engine::State& state) {
  switch (record.kind) {
    case kGraphRecord: {
      BinaryReader reader(record.bytes);
      state.graph.BaseFields(reader);
      return reader.Finish("graph record");
    }
    case kGraphStepsRecord: {
      BinaryReader reader(record.bytes);
      state.graph.StepFields(reader);
      return reader.Finish("graph steps record");
    }
    case kClosuresRecord:
      return Decode(record, "closures", state.closures);
    case kPlaceRecord:
      if (record.id >= kIdsMax) {
        return DataLossError("place record " + std::to_string(record.id) + ": impossible number");
      }
      return Decode(record, "place", Slot(state.places, record.id));
    case kSessionRecord: {
      if (record.id >= kIdsMax) {
        return DataLossError("session record " + std::to_string(record.id) + ": impossible number");
      }
      return Decode(record, "session", Slot(state.sessions, record.id));
    }
    default:
      return {};  // the header was read; pieces follow the sessions; the mesh reads its own
  }
}

Status ReadPieces(const std::vector<StateRecord>& records, Engine::State& state) {
  for (SessionState& session : state.sessions) {
    if (session.piece_count > kIdsMax) {
      return DataLossError("session " + session.session + ": impossible number of poses");
    }
    session.pieces.resize(session.piece_count);
    session.piece_changed_by.resize(session.piece_count);
  }
  for (const StateRecord& record : records) {
    if (record.kind != kPieceRecord) {
      continue;
    }
    const std::size_t session = static_cast<std::size_t>(record.id >> 32U);
    const std::size_t piece = static_cast<std::size_t>(record.id & 0xFFFFFFFFU);
    if (session >= state.sessions.size() || piece >= state.sessions[session].pieces.size()) {
      return DataLossError("trajectory record " + std::to_string(record.id) +
                           ": belongs to no session");
    }
    TrajectoryPiece poses;
    LOCI_RETURN_IF_ERROR(Decode(record, "trajectory", poses));
    state.sessions[session].pieces[piece] =
        std::make_shared<const TrajectoryPiece>(std::move(poses));
  }
  return {};
}

bool PosesFit(const TrajectoryPiece& poses, std::size_t place_count) {
  return std::all_of(poses.begin(), poses.end(), [&](const TrajectoryPose& pose) {
    return pose.place.value < place_count;
  });
}

Status CheckSession(const SessionState& session, const Engine::State& state) {
  const std::size_t places = state.places.size();
  bool fits = session.track.place.value < places && PosesFit(session.newest, places) &&
              (!session.track.previous.has_value() || session.track.previous->value < places);
  for (const auto& piece : session.pieces) {
    fits = fits && piece != nullptr && PosesFit(*piece, places);
  }
  for (const ClosureBatch& batch : session.batches) {
    fits = fits && batch.place.value < places && batch.next <= batch.candidates.size();
    for (const PlaceId candidate : batch.candidates) {
      fits = fits && candidate.value < places;
    }
    for (const ClosureSnapshot& closure : batch.found) {
      fits = fits && closure.from.value < places && closure.to.value < places;
    }
  }
  return fits ? Status() : DataLossError("session " + session.session + ": names missing places");
}

// Every reference from one record to another leads somewhere.
Status CheckReferences(const Engine::State& state) {
  const std::size_t places = state.places.size();
  if (state.graph.map_from_places().size() != places) {
    return DataLossError("graph record: its nodes are not the places");
  }
  LOCI_RETURN_IF_ERROR(Validate(state.settings));
  for (const std::optional<ClosureId>& closure : state.graph.closures()) {
    if (closure.has_value() && closure->value >= state.closures.size()) {
      return DataLossError("graph record: names a missing closure");
    }
  }
  for (std::size_t i = 0; i < places; ++i) {
    if (state.places[i].id.value != i || state.places[i].session.value >= state.sessions.size()) {
      return DataLossError("place record " + std::to_string(i) + ": missing, or of no session");
    }
  }
  for (const PlaceId id : state.consolidation_queue) {
    if (id.value >= places) {
      return DataLossError("header record: names a missing place");
    }
  }
  for (std::size_t i = 0; i < state.closures.size(); ++i) {
    const ClosureSnapshot& closure = state.closures[i];
    if (closure.id.value != i || closure.from.value >= places || closure.to.value >= places) {
      return DataLossError("closures record: names a missing place");
    }
  }
  for (const SessionState& session : state.sessions) {
    LOCI_RETURN_IF_ERROR(CheckSession(session, state));
  }
  return {};
}

}  // namespace

Digest Engine::StateDigest() const {
  HashArchive archive;
  HeaderFields(archive, *state_);
  state_->graph.BaseFields(archive);
  state_->graph.StepFields(archive);
  archive(state_->graph.map_from_places());  // which follow, and are what the rest stands on
  archive(state_->closures, state_->places, state_->sessions);
  for (const SessionState& session : state_->sessions) {
    for (const auto& piece : session.pieces) {
      archive(*piece);
    }
  }
  if (state_->mesh.has_value()) {
    state_->mesh->AddToHash(archive);
  }
  return archive.Finish();
}

Engine::RecordChanges Engine::ChangesSince(EventNumber since) const {
  const State& state = *state_;
  RecordChanges changes;
  BinaryWriter header;
  HeaderFields(header, *state_);
  header(RecordCount(state));
  changes.written.push_back({kHeaderRecord, 0, header.TakeBytes()});
  // Two checkpoints may follow one event; what it wrote belongs to both.
  const auto is_new = [since](EventNumber changed_by) {
    return since.value == 0 || changed_by > since;
  };
  if (is_new(state.graph_base_changed_by)) {
    BinaryWriter base;
    state_->graph.BaseFields(base);
    changes.written.push_back({kGraphRecord, 0, base.TakeBytes()});
  }
  if (is_new(state.graph_changed_by)) {
    BinaryWriter steps;
    state_->graph.StepFields(steps);
    changes.written.push_back({kGraphStepsRecord, 0, steps.TakeBytes()});
  }
  if (is_new(state.closures_changed_by)) {
    changes.written.push_back(RecordOf(kClosuresRecord, 0, state.closures));
  }
  for (const Place& place : state.places) {
    if (is_new(place.changed_by)) {
      changes.written.push_back(RecordOf(kPlaceRecord, place.id.value, place));
    }
  }
  for (std::size_t i = 0; i < state.sessions.size(); ++i) {
    const SessionState& session = state.sessions[i];
    if (is_new(session.changed_by)) {
      changes.written.push_back(RecordOf(kSessionRecord, i, session));
    }
    for (std::size_t piece = 0; piece < session.pieces.size(); ++piece) {
      if (is_new(session.piece_changed_by[piece])) {
        changes.written.push_back(
            RecordOf(kPieceRecord, PieceRecordId(i, piece), *session.pieces[piece]));
      }
    }
  }
  if (state.mesh.has_value()) {
    state.mesh->AppendChanges(since, changes.written, changes.removed);
  }
  return changes;
}

void Engine::ForgetChangesUpTo(EventNumber event) {
  if (state_->mesh.has_value()) {
    state_->mesh->ForgetChangesUpTo(event);
  }
}

StatusOr<Engine> Engine::FromRecords(const std::vector<StateRecord>& records) {
  Engine engine;
  State& state = *engine.state_;
  if (records.empty()) {
    return engine;
  }
  LOCI_RETURN_IF_ERROR(ReadHeader(records, state));
  for (const StateRecord& record : records) {
    LOCI_RETURN_IF_ERROR(ReadRecord(record, state));
  }
  if (state.last_event.value == 0) {
    const bool is_empty = state.places.empty() && state.sessions.empty() &&
                          state.closures.empty() && state.graph.is_empty();
    return is_empty ? StatusOr<Engine>(std::move(engine))
                    : DataLossError("header record: counts no event where there is content");
  }
  LOCI_RETURN_IF_ERROR(ReadPieces(records, state));
  LOCI_RETURN_IF_ERROR(state.graph.Restore());
  LOCI_RETURN_IF_ERROR(CheckReferences(state));
  LOCI_ASSIGN_OR_RETURN(
      Mesh mesh,
      Mesh::FromRecords(state.settings.cell_size_m, records, state.graph.map_from_places()));
  state.mesh.emplace(std::move(mesh));
  state.graph_changed_by = state.last_event;
  state.graph_base_changed_by = state.last_event;
  state.graph_base_count = state.graph.base_count();
  state.closures_changed_by = state.last_event;
  for (Place& place : state.places) {
    place.changed_by = state.last_event;
  }
  for (SessionState& session : state.sessions) {
    session.changed_by = state.last_event;
    std::fill(session.piece_changed_by.begin(), session.piece_changed_by.end(), state.last_event);
    if (session.open) {
      RebuildCaches(state.places[session.track.place.value], session.track);
    }
  }
  return engine;
}

}  // namespace loci
