// SPDX-License-Identifier: Apache-2.0
#include "server/host/append_request.h"

namespace loci {

std::size_t SizeBytes(const AppendRequest& request) {
  // The request itself, its queue's bookkeeping and its callback's.
  std::size_t size_bytes = sizeof(AppendRequest) + 256;
  if (const auto* batch = std::get_if<BatchRequest>(&request.what); batch != nullptr) {
    for (const ObservationEvent& observation : batch->observations) {
      size_bytes += sizeof(ObservationEvent);
      if (observation.scan.has_value()) {
        size_bytes += observation.scan->ranges_mm.size() * sizeof(std::uint16_t);
      }
    }
  }
  return size_bytes;
}

}  // namespace loci
