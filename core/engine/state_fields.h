// SPDX-License-Identifier: Apache-2.0
// The fields of the engine's state: one description for records and for the digest.
#pragma once

#include "core/engine/state.h"

namespace loci {

template <typename Archive>
void Fields(Archive& archive, ClosureSnapshot& closure) {
  archive(closure.id, closure.from, closure.to, closure.state, closure.from_from_to);
  archive(closure.covariance, closure.hausdorff_fraction, closure.overlap_m2);
  archive(closure.free_conflict_fraction, closure.second_peak_ratio, closure.correction_m);
  archive(closure.chi2, closure.reason);
}

template <typename Archive>
void Fields(Archive& archive, ClosureBatch& batch) {
  archive(batch.place, batch.candidates, batch.next, batch.found);
}

// Without the full pieces of the trajectory, which are records of their own.
template <typename Archive>
void Fields(Archive& archive, SessionState& session) {
  archive(session.session, session.robot, session.open, session.map_from_start);
  archive(session.accepted_count, session.refused_count, session.last_number);
  archive(session.first_stamp_ns, session.last_stamp_ns, session.place_count, session.track);
  archive(session.batches, session.newest, session.piece_count);
}

// What is neither a place, a session, a closure, the graph nor the mesh.
template <typename Archive>
void HeaderFields(Archive& archive, Engine::State& state) {
  archive(state.last_event, state.settings, state.cells_integrated, state.cells_closed);
  archive(state.consolidation_queue);
}

}  // namespace loci
