// SPDX-License-Identifier: Apache-2.0
// The calls of the RPC port in numbers, for /metrics.
#pragma once

#include "server/metrics/metrics.h"
#include "server/rpc/counters.h"

namespace loci {

// Calls by method and code, their time and bytes, and what was refused before it was a call.
void CollectRpcMetrics(const RpcCounters& counters, MetricsText& text);

}  // namespace loci
