// SPDX-License-Identifier: Apache-2.0
// Counts of calls since the start, for the metrics: written by the dispatcher, read by anyone.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "core/base/status.h"

namespace loci {

inline constexpr std::size_t kStatusCodeCount = 17;

struct MethodCounters {
  // Calls that are over, by status code.
  std::array<std::atomic<std::uint64_t>, kStatusCodeCount> calls{};
  // From the arrival of a request to its end, summed over all calls that are over.
  std::atomic<std::uint64_t> duration_us_sum{0};
  std::atomic<std::uint64_t> request_bytes{0};
  std::atomic<std::uint64_t> response_bytes{0};
  std::atomic<std::uint64_t> response_messages{0};

  std::uint64_t calls_with(StatusCode code) const {
    return calls[static_cast<std::size_t>(code)].load();
  }
};

struct RpcCounters {
  // By method, "loci.v1.MapQuery/GetTile". Filled before the start and not changed after it.
  std::map<std::string, MethodCounters, std::less<>> methods;
  // Calls of no method that there is.
  MethodCounters unknown_method;
  // Messages ignored: an envelope that does not parse, or whose kind makes no sense here.
  std::atomic<std::uint64_t> envelopes_refused{0};
  // Messages of another protocol version.
  std::atomic<std::uint64_t> versions_refused{0};
  // Requests whose call id was not greater than the one before: repeats.
  std::atomic<std::uint64_t> requests_repeated{0};
  // Requests ignored because their peer does not read what it is sent.
  std::atomic<std::uint64_t> requests_ignored{0};
  // Now:
  std::atomic<std::uint64_t> peers{0};
  std::atomic<std::uint64_t> calls_in_flight{0};
};

}  // namespace loci
