// SPDX-License-Identifier: Apache-2.0
// Proves that what a map serves is what its log says.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "storage/store.h"

namespace loci {

// The served state at one event.
struct ServedState {
  EventNumber last_event;
  std::string state_digest;
};

struct VerificationReport {
  EventNumber last_event;
  EventNumber
      replayed_from;  // last event of the checkpoint that the replay began with; 0: empty map
  std::uint64_t events_replayed = 0;
  std::string state_digest;
};

// Reads everything in the store and checks it, replays from the oldest checkpoint kept to the
// served state's event in an engine of its own, and compares the digests, also with those of the
// checkpoints that it passes. kDataLoss names the first difference or damage; kCancelled.
StatusOr<VerificationReport> VerifyMap(const MapStore& store,
                                       const ServedState& served,
                                       const std::function<bool()>& cancelled);

}  // namespace loci
