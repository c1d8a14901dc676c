// SPDX-License-Identifier: Apache-2.0
// The maps of a server in numbers, for /metrics.
#pragma once

#include "server/metrics/metrics.h"
#include "server/snapshot_source.h"

namespace loci {

// Per map: its state, revision, queues, log, places, closures, and cells written by cause.
void CollectMapMetrics(const SnapshotSource& maps, MetricsText& text);

}  // namespace loci
