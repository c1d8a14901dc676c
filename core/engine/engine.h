// SPDX-License-Identifier: Apache-2.0
// The map engine: a deterministic state machine (design.md, section 3).
//
// The same events in the same order give the same state, bit for bit. No clock, no thread, no file:
// what is to be done outside is returned as effects.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/hash.h"
#include "core/base/ids.h"
#include "core/base/state_record.h"
#include "core/base/status.h"
#include "core/engine/event.h"
#include "core/engine/snapshot.h"

namespace loci {

// What an event did, for those who watch. Not part of the state.
struct Effects {
  bool closure_accepted = false;   // the pose graph was optimised and everything moved
  std::uint32_t places_moved = 0;  // by that, for more than a millimetre or a milliradian
  bool place_finished = false;
};

// Counts for `map info`.
struct EngineCounts {
  std::uint64_t sessions = 0;
  std::uint64_t places = 0;
  std::uint64_t ltrs = 0;
  std::uint64_t closures = 0;  // accepted
};

// One map. Not thread-safe: one thread applies events and takes snapshots.
class Engine {
 public:
  Engine();  // the empty map: nothing applied, not even its creation
  ~Engine();
  Engine(Engine&&) noexcept;
  Engine& operator=(Engine&&) noexcept;

  // Applies the event with number last_event() + 1. It must have been admitted (AdmissionControl);
  // one that was not is an error of ours and ends the process.
  Effects Apply(const Event& event);

  EventNumber last_event() const;

  // Hash over all state in a defined order, without caches and publication counters. An engine
  // without events has a digest too.
  Digest StateDigest() const;

  // The state for readers. Costs pointers, not cells.
  std::shared_ptr<const Snapshot> TakeSnapshot();

  EngineCounts Counts() const;

  // Gives every record that changed after the event `since` (0: all records). Records are never
  // deleted under their name except those listed by `removed`.
  struct RecordChanges {
    std::vector<StateRecord> written;
    std::vector<std::pair<std::uint32_t, std::uint64_t>> removed;  // (kind, id)
  };
  RecordChanges ChangesSince(EventNumber since) const;
  // Nobody will ask for changes since an event before `event` any more: drops the bookkeeping.
  void ForgetChangesUpTo(EventNumber event);

  // An engine from all records of a checkpoint, in any order. kDataLoss if they do not fit
  // together.
  static StatusOr<Engine> FromRecords(const std::vector<StateRecord>& records);

  struct State;  // core/engine/state.h

 private:
  std::unique_ptr<State> state_;
};

}  // namespace loci
