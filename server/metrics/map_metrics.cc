// SPDX-License-Identifier: Apache-2.0
#include "server/metrics/map_metrics.h"

#include <cstdint>
#include <string>

namespace loci {
namespace {

double AsNumber(std::uint64_t count) {
  return static_cast<double>(count);
}

void CollectCells(const CellsWritten& cells, const MetricLabels& map, MetricsText& text) {
  const auto add = [&](const char* cause, std::uint64_t count) {
    MetricLabels labels = map;
    labels.emplace_back("cause", cause);
    text.AddCounter("loci_map_cells_written_total",
                    "Cells of dense layers written, by cause.",
                    labels,
                    AsNumber(count));
  };
  add("integrate", cells.integrate);
  add("consolidate", cells.consolidate);
  add("remesh", cells.remesh);
  add("closure", cells.closure);
}

void CollectSnapshot(const Snapshot& snapshot, const MetricLabels& map, MetricsText& text) {
  text.AddGauge("loci_map_revision", "Newest revision.", map, AsNumber(snapshot.revision.value));
  text.AddGauge("loci_map_places", "Places in the graph.", map, AsNumber(snapshot.places.size()));
  text.AddGauge(
      "loci_map_sessions", "Sessions, ended ones too.", map, AsNumber(snapshot.sessions.size()));
  text.AddGauge(
      "loci_map_closures", "Accepted loop closures.", map, AsNumber(snapshot.closures_accepted));
  text.AddGauge("loci_map_chi2", "chi2 of the pose graph.", map, snapshot.chi2);
  std::uint64_t accepted = 0;
  std::uint64_t refused = 0;
  for (const SessionSnapshot& session : snapshot.sessions) {
    accepted += session.accepted_count;
    refused += session.refused_count;
  }
  text.AddCounter(
      "loci_map_observations_accepted_total", "Observations accepted.", map, AsNumber(accepted));
  text.AddCounter(
      "loci_map_observations_refused_total", "Observations refused.", map, AsNumber(refused));
  CollectCells(snapshot.cells_written, map, text);
}

}  // namespace

void CollectMapMetrics(const SnapshotSource& maps, MetricsText& text) {
  for (const MapStatus& status : maps.Maps()) {
    const MetricLabels map = {{"map", status.map}};
    text.AddGauge("loci_map_serving",
                  "1 if the map is served, 0 if it recovers or is refused.",
                  map,
                  status.state == MapState::kServing ? 1.0 : 0.0);
    text.AddGauge("loci_map_refused",
                  "1 if the map is damaged or its disk failed.",
                  map,
                  status.state == MapState::kRefused ? 1.0 : 0.0);
    text.AddGauge("loci_map_last_event", "Last durable event.", map, AsNumber(status.last_event));
    text.AddGauge("loci_map_last_checkpoint_event",
                  "Event of the newest checkpoint, 0 for none.",
                  map,
                  AsNumber(status.last_checkpoint));
    text.AddGauge("loci_map_recovered_from_event",
                  "Event of the checkpoint that the map was opened with, 0 for none.",
                  map,
                  AsNumber(status.recovered_from));
    text.AddGauge("loci_map_recovery_replayed_events",
                  "Events that were replayed when the map was opened.",
                  map,
                  AsNumber(status.events_replayed));
    text.AddGauge("loci_map_events_waiting",
                  "Events that are durable and not yet applied.",
                  map,
                  AsNumber(status.events_waiting));
    text.AddGauge("loci_map_request_bytes_waiting",
                  "Bytes of requests that are not yet durable.",
                  map,
                  AsNumber(status.bytes_waiting));
    text.AddCounter(
        "loci_map_appends_total", "Transactions of the event log.", map, AsNumber(status.appends));
    text.AddCounter("loci_map_append_failures_total",
                    "Appends that the disk refused.",
                    map,
                    AsNumber(status.append_failures));
    text.AddCounter("loci_map_state_digests_total",
                    "Times that the whole state was hashed.",
                    map,
                    AsNumber(status.digests));
    text.AddGauge("loci_map_last_closure_seconds",
                  "Time of the event that last closed a loop.",
                  map,
                  status.closures.last_ms / 1000.0);
    text.AddGauge("loci_map_closure_seconds_max",
                  "Longest time of such an event since the map was opened.",
                  map,
                  status.closures.max_ms / 1000.0);
    text.AddCounter("loci_map_closure_seconds_total",
                    "Time of all such events since the map was opened.",
                    map,
                    status.closures.total_ms / 1000.0);
    text.AddCounter("loci_map_closure_events_total",
                    "Events that closed loops since the map was opened.",
                    map,
                    AsNumber(status.closures.events));
    text.AddGauge(
        "loci_map_last_closure_places_moved",
        "Places that the event that last closed a loop moved by more than a millimetre or a "
        "milliradian.",
        map,
        AsNumber(status.closures.last_places_moved));
    if (status.newest) {
      CollectSnapshot(*status.newest, map, text);
    }
  }
}

}  // namespace loci
