// SPDX-License-Identifier: Apache-2.0
// What callers ask a map's appender to write, and what they are told.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "core/engine/event.h"

namespace loci {

// Opens the session, or finds it open again with the same robot and start.
struct OpenRequest {
  std::string robot;
  Pose2 map_from_start;
};

// Observations numbered first_number, first_number + 1 and so on. Each is valid by itself
// (ValidateEvent); their `session` and `number` are set by the appender.
struct BatchRequest {
  std::uint64_t first_number = 1;
  std::vector<ObservationEvent> observations;
};

// Closes the session, or finds it closed.
struct CloseRequest {};

// An observation whose number was consumed without effect.
struct RefusedObservation {
  std::uint64_t number = 0;
  std::string reason;
};

// A request that is done: all that it asked for is durable.
struct AppendOutcome {
  SessionId session;
  std::uint64_t last_durable_number = 0;    // of the session's observations
  std::vector<RefusedObservation> refused;  // by this request
};

struct AppendRequest {
  using Done = std::function<void(StatusOr<AppendOutcome>)>;

  std::string session;
  std::variant<OpenRequest, BatchRequest, CloseRequest> what;
  Done done;  // called once, on any thread; must be quick
};

// Bytes that a request holds while it waits.
std::size_t SizeBytes(const AppendRequest& request);

}  // namespace loci
