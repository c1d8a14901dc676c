// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/session_backlog.h"

#include <algorithm>

namespace loci::client {
namespace {

constexpr std::size_t kRefusalsKeptMax = 1000;

}  // namespace

void SessionBacklog::TakeAnswer(const v1::AppendBatchResponse& answer) {
  progress.last_durable_number =
      std::max(progress.last_durable_number, answer.last_durable_number());
  if (answer.has_map_from_odom() && answer.revision() >= progress.revision) {
    progress.map_from_odom = answer.map_from_odom();
    progress.revision = answer.revision();
  }
  progress.refused_count += static_cast<std::uint64_t>(answer.refused_size());
  for (const v1::RefusedObservation& refused : answer.refused()) {
    if (refusals.size() < kRefusalsKeptMax) {
      refusals.push_back({refused.number(), refused.reason()});
    }
  }
}

void SessionBacklog::DropDurable() {
  while (!batches.empty() && !batches.front().in_flight &&
         batches.front().last_number <= progress.last_durable_number) {
    batches.pop_front();
  }
}

void SessionBacklog::OnAnswer(std::uint64_t first_number,
                              const StatusOr<v1::AppendBatchResponse>& answer) {
  {
    const std::lock_guard lock(mutex);
    const auto batch = std::find_if(batches.begin(), batches.end(), [&](const Batch& one) {
      return one.request.first_number() == first_number;
    });
    --in_flight;
    batch->in_flight = false;
    batch->answered = true;
    batch->status = answer.status();
    if (answer.ok()) {
      TakeAnswer(*answer);
      if (progress.last_durable_number < batch->last_number) {
        batch->status = InternalError("the server answered a batch without making it durable");
      }
    }
    DropDurable();
  }
  changed.notify_all();
}

}  // namespace loci::client
