// SPDX-License-Identifier: Apache-2.0
#include "server/convert/map_admin_convert.h"

#include "server/convert/pose_convert.h"

namespace loci {
namespace {

v1::ClosureState StateOf(ClosureState state) {
  switch (state) {
    case ClosureState::kProvisional:
      return v1::CLOSURE_STATE_PROVISIONAL;
    case ClosureState::kAccepted:
      return v1::CLOSURE_STATE_ACCEPTED;
    case ClosureState::kRejected:
      return v1::CLOSURE_STATE_REJECTED;
  }
  return v1::CLOSURE_STATE_UNSPECIFIED;
}

// A map that is being recovered is not healthy yet, and says so.
std::string ProblemOf(const MapStatus& status) {
  return status.state == MapState::kRecovering ? "recovering: its log is being replayed"
                                               : status.problem;
}

}  // namespace

MapSettings SettingsFrom(const v1::MapSettings& message) {
  MapSettings settings;
  if (message.has_cell_size_m()) {
    settings.cell_size_m = message.cell_size_m();
  }
  if (message.has_place_length_m()) {
    settings.place_length_m = message.place_length_m();
  }
  if (message.has_range_max_m()) {
    settings.range_max_m = message.range_max_m();
  }
  if (message.has_seed()) {
    settings.seed = message.seed();
  }
  return settings;
}

void Fill(const MapSettings& settings, v1::MapSettings& message) {
  message.set_cell_size_m(settings.cell_size_m);
  message.set_place_length_m(settings.place_length_m);
  message.set_range_max_m(settings.range_max_m);
  message.set_seed(settings.seed);
}

void Fill(const HostedMapInfo& info, v1::MapInfo& message) {
  message.set_revision(info.last_event.value);
  message.set_last_event(info.last_event.value);
  message.set_state_digest(info.state_digest);
  message.set_sessions(info.counts.sessions);
  message.set_places(info.counts.places);
  message.set_ltrs(info.counts.ltrs);
  message.set_closures(info.counts.closures);
  v1::FileBytes& bytes = *message.mutable_file_bytes();
  bytes.set_map(info.file_bytes.map);
  bytes.set_history(info.file_bytes.history);
  bytes.set_log(info.file_bytes.log);
  bytes.set_total(info.file_bytes.total);
  Fill(info.settings, *message.mutable_settings());
}

void Fill(const MapStatus& status, v1::ListMapsResponse::Entry& message) {
  message.set_map(status.map);
  const std::string problem = ProblemOf(status);
  message.set_healthy(problem.empty());
  message.set_problem(problem);
  message.set_revision(status.newest == nullptr ? 0 : status.newest->revision.value);
}

void Fill(const MapStatus& status, v1::ServerStatus::Map& message) {
  message.set_map(status.map);
  message.set_problem(ProblemOf(status));
  message.set_events_waiting(status.events_waiting);
  message.set_last_closure_ms(status.closures.last_ms);
  message.set_max_closure_ms(status.closures.max_ms);
  message.set_last_closure_places_moved(status.closures.last_places_moved);
  message.set_last_checkpoint(status.last_checkpoint);
  message.set_recovered_from(status.recovered_from);
  message.set_events_replayed(status.events_replayed);
  if (status.newest == nullptr) {
    return;
  }
  message.set_revision(status.newest->revision.value);
  message.set_closures(status.newest->closures_accepted);
  message.set_chi2(status.newest->chi2);
  v1::CellsWritten& cells = *message.mutable_cells_written();
  cells.set_integrate(status.newest->cells_written.integrate);
  cells.set_consolidate(status.newest->cells_written.consolidate);
  cells.set_remesh(status.newest->cells_written.remesh);
  cells.set_closure(status.newest->cells_written.closure);
}

void Fill(const VerificationReport& report, v1::VerifyMapResponse& message) {
  message.set_last_event(report.last_event.value);
  message.set_replayed_from(report.replayed_from.value);
  message.set_events_replayed(report.events_replayed);
  message.set_state_digest(report.state_digest);
}

void Fill(const ClosureSnapshot& closure, v1::Closure& message) {
  message.set_id(closure.id.value);
  message.set_from_place(closure.from.value);
  message.set_to_place(closure.to.value);
  message.set_state(StateOf(closure.state));
  message.set_x(closure.from_from_to.x);
  message.set_y(closure.from_from_to.y);
  message.set_theta(closure.from_from_to.theta);
  FillUpper(closure.covariance, *message.mutable_covariance());
  message.set_hausdorff_fraction(closure.hausdorff_fraction);
  message.set_overlap_m2(closure.overlap_m2);
  message.set_free_conflict_fraction(closure.free_conflict_fraction);
  message.set_second_peak_ratio(closure.second_peak_ratio);
  message.set_correction_m(closure.correction_m);
  message.set_chi2(closure.chi2);
  message.set_reason(closure.reason);
}

}  // namespace loci
