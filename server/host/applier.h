// SPDX-License-Identifier: Apache-2.0
// Applies a map's durable events in log order and publishes revisions.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/engine/engine.h"
#include "server/base/mutex.h"
#include "server/config.h"
#include "server/host/checkpointer.h"
#include "server/host/publisher.h"
#include "server/snapshot_source.h"

namespace loci {

// An event that is in the log.
struct DurableEvent {
  EventNumber number;
  Event event;
  std::size_t size_bytes = 0;
};

// For metrics.
struct ApplierCounts {
  std::uint64_t events_waiting = 0;
  ClosureTimes closures;
  std::uint64_t digests = 0;  // times that the whole state was hashed
};

// Owns the map's engine. All work happens on the thread that calls Run; the rest is thread-safe.
class Applier {
 public:
  // Is given the engine after everything that was pushed before is applied and published; null if
  // the applier stopped before that.
  using Task = std::function<void(const Engine*)>;

  // Publishes the engine's state. References must outlive the applier.
  Applier(const HostLimits& limits,
          Publisher& publisher,
          Checkpointer& checkpointer,
          Engine engine);

  // Applies and publishes until RequestStop.
  void Run() LOCI_EXCLUDES(mutex_);

  // Queues events, in log order.
  void Push(std::vector<DurableEvent> events) LOCI_EXCLUDES(mutex_);
  // Queues a task behind all events pushed so far.
  void Post(Task task) LOCI_EXCLUDES(mutex_);
  // Waits while more events are queued than HostLimits allows. Returns at once after RequestStop.
  void WaitForRoom() LOCI_EXCLUDES(mutex_);
  // Run ends after the event that it applies now. What is queued is dropped: it is in the log.
  void RequestStop() LOCI_EXCLUDES(mutex_);

  ApplierCounts Counts() const LOCI_EXCLUDES(mutex_);

  // By a task, or after Run has returned:
  const Engine& engine() const { return engine_; }
  // The engine's digest, hexadecimal. Hashing takes as long as reading the whole state, and holds
  // up the events behind it: it is done once for each event, however often it is asked for.
  const std::string& StateDigest() LOCI_EXCLUDES(mutex_);

 private:
  using Work = std::variant<DurableEvent, Task>;
  struct Publish {};
  struct Stop {};
  using NextStep = std::variant<Stop, Publish, DurableEvent, Task>;

  NextStep WaitForStep() LOCI_EXCLUDES(mutex_);
  void ApplyEvent(const DurableEvent& durable) LOCI_EXCLUDES(mutex_);
  void WriteCheckpointIfDue();
  void PublishIfChanged();
  void DropQueue() LOCI_EXCLUDES(mutex_);

  const HostLimits limits_;
  Publisher& publisher_;
  Checkpointer& checkpointer_;

  // Of Run's thread alone:
  Engine engine_;
  bool changed_ = true;           // since the last publication
  bool everything_moved_ = true;  // since the last publication
  std::chrono::steady_clock::time_point published_at_;
  std::optional<EventNumber> digest_of_;  // what state_digest_ is of
  std::string state_digest_;

  mutable Mutex mutex_;
  ConditionVariable wake_;
  ConditionVariable room_;
  std::deque<Work> queue_ LOCI_GUARDED_BY(mutex_);
  std::size_t events_waiting_ LOCI_GUARDED_BY(mutex_) = 0;
  std::size_t bytes_waiting_ LOCI_GUARDED_BY(mutex_) = 0;
  ClosureTimes closures_ LOCI_GUARDED_BY(mutex_);
  std::uint64_t digests_ LOCI_GUARDED_BY(mutex_) = 0;
  bool stopping_ LOCI_GUARDED_BY(mutex_) = false;
  bool ended_ LOCI_GUARDED_BY(mutex_) = false;  // Run will look at the queue no more
};

}  // namespace loci
