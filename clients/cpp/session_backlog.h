// SPDX-License-Identifier: Apache-2.0
// What a mapping session was given and is not durable yet, and how far it got.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <vector>

#include "clients/cpp/mapping_session.h"
#include "core/base/status.h"
#include "loci/v1/mapping.pb.h"

namespace loci::client {

// One AppendBatch call, made again until it is durable.
struct Batch {
  v1::AppendBatchRequest request;
  std::uint64_t last_number = 0;
  bool in_flight = false;
  bool answered = false;  // well or badly
  Status status;
};

// Shared by the session's threads and the callbacks of its calls. Callbacks may come after the
// session's end, so they hold it. The mutex guards all that follows it.
struct SessionBacklog {
  std::mutex mutex;
  std::condition_variable changed;
  bool stopping = false;
  Status failure;  // final

  std::vector<v1::Observation> waiting;  // for a batch
  std::size_t waiting_bytes = 0;
  std::chrono::steady_clock::time_point waiting_since;
  bool flushing = false;

  std::deque<Batch> batches;  // sent or to be sent, not durable, in order
  std::size_t in_flight = 0;
  MappingProgress progress;
  std::vector<Refusal> refusals;

  // By the callback of the batch that begins with this number; takes the mutex.
  void OnAnswer(std::uint64_t first_number, const StatusOr<v1::AppendBatchResponse>& answer);

  // With the mutex held:
  void TakeAnswer(const v1::AppendBatchResponse& answer);
  void DropDurable();
};

}  // namespace loci::client
