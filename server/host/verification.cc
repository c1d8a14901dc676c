// SPDX-License-Identifier: Apache-2.0
#include "server/host/verification.h"

#include <utility>
#include <vector>

#include "core/engine/admission.h"
#include "core/engine/engine.h"
#include "server/host/recovery.h"

namespace loci {
namespace {

Status CompareDigest(const Engine& engine, const std::string& expected, const char* whose) {
  const std::string replayed = engine.StateDigest().ToHex();
  if (replayed == expected) {
    return {};
  }
  return DataLossError("event " + std::to_string(engine.last_event().value) +
                       ": the replay's digest is " + replayed + ", that of " + whose + " is " +
                       expected);
}

// One attempt; kNotFound if a checkpoint that was listed is replaced by newer ones meanwhile.
StatusOr<VerificationReport> Attempt(const MapStore& store,
                                     const ServedState& served,
                                     const std::function<bool()>& cancelled) {
  LOCI_ASSIGN_OR_RETURN(const std::vector<CheckpointInfo> checkpoints, store.ListCheckpoints());
  Engine engine;
  AdmissionControl admission;
  if (!checkpoints.empty() && checkpoints.front().last_event <= served.last_event) {
    LOCI_ASSIGN_OR_RETURN(engine, LoadCheckpoint(store, checkpoints.front()));
    admission = AdmissionControl::FromSnapshot(*engine.TakeSnapshot());
  }
  VerificationReport report;
  report.last_event = served.last_event;
  report.replayed_from = engine.last_event();
  report.state_digest = served.state_digest;
  const auto compare_with_checkpoints = [&](const Engine& replayed) -> Status {
    for (const CheckpointInfo& checkpoint : checkpoints) {
      if (checkpoint.last_event == replayed.last_event()) {
        LOCI_RETURN_IF_ERROR(CompareDigest(replayed, checkpoint.state_digest, "its checkpoint"));
      }
    }
    return {};
  };
  LOCI_ASSIGN_OR_RETURN(report.events_replayed,
                        Replay(store,
                               {.last = served.last_event,
                                .cancelled = cancelled,
                                .after_event = compare_with_checkpoints},
                               engine,
                               admission));
  if (engine.last_event() != served.last_event) {
    return DataLossError("the log ends at event " + std::to_string(engine.last_event().value) +
                         ", the served state is of event " +
                         std::to_string(served.last_event.value));
  }
  LOCI_RETURN_IF_ERROR(CompareDigest(engine, served.state_digest, "the served state"));
  return report;
}

}  // namespace

StatusOr<VerificationReport> VerifyMap(const MapStore& store,
                                       const ServedState& served,
                                       const std::function<bool()>& cancelled) {
  LOCI_RETURN_IF_ERROR(store.CheckIntegrity());
  for (;;) {
    StatusOr<VerificationReport> report = Attempt(store, served, cancelled);
    if (report.ok() || report.status().code() != StatusCode::kNotFound) {
      return report;
    }
  }
}

}  // namespace loci
