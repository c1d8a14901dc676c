// SPDX-License-Identifier: Apache-2.0
// Brings a map back from its store: newest checkpoint, then replay of the log.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "core/engine/admission.h"
#include "core/engine/engine.h"
#include "storage/store.h"

namespace loci {

// A map as its store has it.
struct RecoveredMap {
  Engine engine;
  AdmissionControl admission;  // has followed every event of the log
  EventNumber checkpoint;      // that the replay began with; 0 for none
  std::uint64_t events_replayed = 0;
};

// An engine from a checkpoint whose digest was checked. kDataLoss names the checkpoint.
StatusOr<Engine> LoadCheckpoint(const MapStore& store, const CheckpointInfo& info);

// Applies the log's events after engine.last_event(), up to and including `last` if it is given.
// Every event is checked first: kDataLoss for one that cannot be applied. `cancelled` is asked
// before each event; kCancelled.
// Returns how many were applied.
struct ReplayOptions {
  std::optional<EventNumber> last;
  std::function<bool()> cancelled;
  std::function<Status(const Engine&)> after_event;  // may be empty
};
StatusOr<std::uint64_t> Replay(const MapStore& store,
                               const ReplayOptions& options,
                               Engine& engine,
                               AdmissionControl& admission);

// Starts from the newest checkpoint that can be read and goes back over older ones to the empty
// map, which needs the log from its first event. `map` is for the log of the server.
// Errors: kDataLoss says what is damaged and what to do; kNotFound for a store without any event;
// kCancelled.
StatusOr<RecoveredMap> RecoverMap(const std::string& map,
                                  const MapStore& store,
                                  const std::function<bool()>& cancelled);

}  // namespace loci
