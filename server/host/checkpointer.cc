// SPDX-License-Identifier: Apache-2.0
#include "server/host/checkpointer.h"

#include <utility>
#include <vector>

#include <spdlog/spdlog.h>

namespace loci {
namespace {

CheckpointChanges TakeChanges(const Engine& engine,
                              const std::string& state_digest,
                              EventNumber since) {
  Engine::RecordChanges changes = engine.ChangesSince(since);
  return {.last_event = engine.last_event(),
          .since = since,
          .state_digest = state_digest,
          .written = std::move(changes.written),
          .removed = std::move(changes.removed)};
}

}  // namespace

Checkpointer::Checkpointer(std::string map,
                           const HostLimits& limits,
                           const Clock& clock,
                           MapStore& store,
                           EventNumber last,
                           std::uint64_t replayed)
    : map_(std::move(map)),
      limits_(limits),
      clock_(clock),
      store_(store),
      last_written_(last),
      events_since_(replayed) {
  thread_ = std::thread([this] { Run(); });
}

Checkpointer::~Checkpointer() {
  Stop();
}

void Checkpointer::CountEvent(std::size_t size_bytes) {
  const MutexLock lock(mutex_);
  ++events_since_;
  bytes_since_ += size_bytes;
}

bool Checkpointer::IsDue() const {
  const MutexLock lock(mutex_);
  const bool due =
      events_since_ >= limits_.checkpoint_events || bytes_since_ >= limits_.checkpoint_log_bytes;
  return due && !busy_ && !stopping_ && (!not_before_.has_value() || clock_.Now() >= *not_before_);
}

void Checkpointer::Begin(const Engine& engine, const std::string& state_digest) {
  CheckpointChanges changes = TakeChanges(engine, state_digest, last_written());
  const MutexLock lock(mutex_);
  events_since_ = 0;
  bytes_since_ = 0;
  busy_ = true;
  handed_ = std::move(changes);
  wake_.NotifyAll();
}

void Checkpointer::Stop() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    wake_.NotifyAll();
  }
  if (thread_.joinable()) {
    thread_.join();
  }
}

Status Checkpointer::WriteNow(const Engine& engine, const std::string& state_digest) {
  return Write(TakeChanges(engine, state_digest, last_written()));
}

EventNumber Checkpointer::last_written() const {
  const MutexLock lock(mutex_);
  return last_written_;
}

void Checkpointer::Run() {
  for (;;) {
    std::optional<CheckpointChanges> changes;
    {
      const MutexLock lock(mutex_);
      while (!handed_.has_value() && !stopping_) {
        wake_.Wait(mutex_);
      }
      if (!handed_.has_value()) {
        return;
      }
      changes = std::exchange(handed_, std::nullopt);
    }
    const Status status = Write(*changes);
    const MutexLock lock(mutex_);
    busy_ = false;
    if (!status.ok()) {
      not_before_ = clock_.Now() + limits_.checkpoint_retry;
      events_since_ = limits_.checkpoint_events;  // due as soon as it may be
    }
  }
}

Status Checkpointer::Write(const CheckpointChanges& changes) {
  const TimePoint begin = clock_.Now();
  const Status status = store_.WriteCheckpoint(changes);
  if (!status.ok()) {
    spdlog::warn("event=checkpoint_failed map={} at={} problem=\"{}\"",
                 map_,
                 changes.last_event.value,
                 status.ToString());
    // A commit whose answer was lost may have happened all the same: the changes of the next one
    // must count from what the store has.
    if (const StatusOr<std::vector<CheckpointInfo>> kept = store_.ListCheckpoints();
        kept.ok() && !kept->empty() && kept->back().last_event == changes.last_event) {
      const MutexLock lock(mutex_);
      last_written_ = changes.last_event;
    }
    return status;
  }
  const auto duration = std::chrono::duration_cast<std::chrono::milliseconds>(clock_.Now() - begin);
  spdlog::info("event=checkpoint_written map={} at={} records={} ms={}",
               map_,
               changes.last_event.value,
               changes.written.size(),
               duration.count());
  const MutexLock lock(mutex_);
  last_written_ = changes.last_event;
  return {};
}

}  // namespace loci
