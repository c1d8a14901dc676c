// SPDX-License-Identifier: Apache-2.0
#include "server/metrics/rpc_metrics.h"

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

#include "core/base/status.h"

namespace loci {
namespace {

double AsNumber(const std::atomic<std::uint64_t>& count) {
  return static_cast<double>(count.load(std::memory_order_relaxed));
}

void CollectMethod(const std::string& method, const MethodCounters& counters, MetricsText& text) {
  const MetricLabels labels = {{"method", method}};
  for (std::size_t code = 0; code < kStatusCodeCount; ++code) {
    // Codes that never came are left out: 17 lines for each method would hide the others.
    if (counters.calls[code].load(std::memory_order_relaxed) == 0) {
      continue;
    }
    MetricLabels with_code = labels;
    with_code.emplace_back("code", StatusCodeName(static_cast<StatusCode>(code)));
    text.AddCounter("loci_rpc_calls_total",
                    "Calls that are over, by method and status code.",
                    with_code,
                    AsNumber(counters.calls[code]));
  }
  text.AddCounter("loci_rpc_call_seconds_total",
                  "Time from request to end, summed over calls.",
                  labels,
                  1e-6 * AsNumber(counters.duration_us_sum));
  text.AddCounter("loci_rpc_request_bytes_total",
                  "Bytes of requests.",
                  labels,
                  AsNumber(counters.request_bytes));
  text.AddCounter("loci_rpc_response_bytes_total",
                  "Bytes of responses.",
                  labels,
                  AsNumber(counters.response_bytes));
  text.AddCounter("loci_rpc_response_messages_total",
                  "Messages of responses.",
                  labels,
                  AsNumber(counters.response_messages));
}

}  // namespace

void CollectRpcMetrics(const RpcCounters& counters, MetricsText& text) {
  for (const auto& [method, method_counters] : counters.methods) {
    CollectMethod(method, method_counters, text);
  }
  CollectMethod("unknown", counters.unknown_method, text);
  text.AddCounter("loci_rpc_envelopes_refused_total",
                  "Messages that are no envelope of ours.",
                  {},
                  AsNumber(counters.envelopes_refused));
  text.AddCounter("loci_rpc_versions_refused_total",
                  "Messages of another protocol version.",
                  {},
                  AsNumber(counters.versions_refused));
  text.AddCounter("loci_rpc_requests_repeated_total",
                  "Requests that came twice.",
                  {},
                  AsNumber(counters.requests_repeated));
  text.AddCounter("loci_rpc_requests_ignored_total",
                  "Requests of peers that do not read.",
                  {},
                  AsNumber(counters.requests_ignored));
  text.AddGauge("loci_rpc_peers", "Peers that are connected.", {}, AsNumber(counters.peers));
  text.AddGauge(
      "loci_rpc_calls_in_flight", "Calls under way.", {}, AsNumber(counters.calls_in_flight));
}

}  // namespace loci
