// SPDX-License-Identifier: Apache-2.0
#include "server/host/recovery.h"

#include <utility>
#include <vector>

#include <spdlog/spdlog.h>

namespace loci {
namespace {

constexpr const char* kWhatToDo =
    "; restore the map's file from a backup, or delete the map and stream its logs again";

Status WithAdvice(const Status& status) {
  return {status.code(), status.message() + kWhatToDo};
}

}  // namespace

StatusOr<Engine> LoadCheckpoint(const MapStore& store, const CheckpointInfo& info) {
  const std::string name = "checkpoint at event " + std::to_string(info.last_event.value);
  LOCI_ASSIGN_OR_RETURN(const Checkpoint checkpoint, store.ReadCheckpoint(info.last_event));
  StatusOr<Engine> engine = Engine::FromRecords(checkpoint.records);
  if (!engine.ok()) {
    return DataLossError(name + ": " + engine.status().message());
  }
  if (engine->last_event() != checkpoint.last_event) {
    return DataLossError(name + ": its records are of event " +
                         std::to_string(engine->last_event().value));
  }
  const std::string digest = engine->StateDigest().ToHex();
  if (digest != checkpoint.state_digest) {
    return DataLossError(name + ": the digest of its records is " + digest + ", must be " +
                         checkpoint.state_digest);
  }
  return engine;
}

StatusOr<std::uint64_t> Replay(const MapStore& store,
                               const ReplayOptions& options,
                               Engine& engine,
                               AdmissionControl& admission) {
  std::uint64_t applied = 0;
  bool done = false;
  const auto apply = [&](const LogEntry& entry) -> Status {
    if (options.cancelled()) {
      return CancelledError("the replay was stopped");
    }
    if (options.last.has_value() && entry.number > *options.last) {
      done = true;
      return CancelledError("the last event to replay was reached");
    }
    const std::string name = "event " + std::to_string(entry.number.value);
    if (entry.number.value != engine.last_event().value + 1) {
      return DataLossError(name + " follows event " + std::to_string(engine.last_event().value) +
                           ": events are missing from the log");
    }
    const StatusOr<Event> event = DecodeEvent(entry.bytes);
    if (!event.ok()) {
      return DataLossError(name + ": " + event.status().message());
    }
    if (const Status status = admission.Check(*event); !status.ok()) {
      return DataLossError(name + " cannot be applied: " + status.message());
    }
    admission.Admit(*event);
    engine.Apply(*event);
    ++applied;
    return options.after_event ? options.after_event(engine) : Status();
  };
  const Status status = store.ReadLog(engine.last_event(), apply);
  if (!status.ok() && !done) {
    return status;
  }
  return applied;
}

StatusOr<RecoveredMap> RecoverMap(const std::string& map,
                                  const MapStore& store,
                                  const std::function<bool()>& cancelled) {
  RecoveredMap recovered;
  LOCI_ASSIGN_OR_RETURN(const std::vector<CheckpointInfo> checkpoints, store.ListCheckpoints());
  for (auto info = checkpoints.rbegin(); info != checkpoints.rend(); ++info) {
    StatusOr<Engine> engine = LoadCheckpoint(store, *info);
    if (engine.ok()) {
      recovered.engine = std::move(engine).value();
      recovered.admission = AdmissionControl::FromSnapshot(*recovered.engine.TakeSnapshot());
      recovered.checkpoint = info->last_event;
      break;
    }
    spdlog::error(
        "event=checkpoint_damaged map={} problem=\"{}\" next=\"an older one and a longer replay\"",
        map,
        engine.status().ToString());
  }
  const ReplayOptions options{.last = std::nullopt, .cancelled = cancelled, .after_event = {}};
  StatusOr<std::uint64_t> replayed = Replay(store, options, recovered.engine, recovered.admission);
  if (!replayed.ok()) {
    return replayed.status().code() == StatusCode::kCancelled ? replayed.status()
                                                              : WithAdvice(replayed.status());
  }
  recovered.events_replayed = *replayed;
  if (recovered.engine.last_event() != store.LastEvent()) {
    return WithAdvice(DataLossError("the log ends at event " +
                                    std::to_string(recovered.engine.last_event().value) +
                                    ", must end at " + std::to_string(store.LastEvent().value)));
  }
  if (recovered.engine.last_event().value == 0) {
    return NotFoundError("its creation was cut short: create it again, or delete it");
  }
  return recovered;
}

}  // namespace loci
