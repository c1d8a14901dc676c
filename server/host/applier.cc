// SPDX-License-Identifier: Apache-2.0
#include "server/host/applier.h"

#include <algorithm>
#include <utility>

namespace loci {

using std::chrono::steady_clock;

Applier::Applier(const HostLimits& limits,
                 Publisher& publisher,
                 Checkpointer& checkpointer,
                 Engine engine)
    : limits_(limits),
      publisher_(publisher),
      checkpointer_(checkpointer),
      engine_(std::move(engine)) {
  PublishIfChanged();
}

void Applier::Run() {
  WriteCheckpointIfDue();
  for (;;) {
    NextStep step = WaitForStep();
    if (std::holds_alternative<Stop>(step)) {
      break;
    }
    if (const auto* durable = std::get_if<DurableEvent>(&step); durable != nullptr) {
      ApplyEvent(*durable);
    } else {
      PublishIfChanged();
      if (const auto* task = std::get_if<Task>(&step); task != nullptr) {
        (*task)(&engine_);
      }
    }
  }
  DropQueue();
}

void Applier::Push(std::vector<DurableEvent> events) {
  const MutexLock lock(mutex_);
  if (ended_) {
    return;
  }
  for (DurableEvent& durable : events) {
    ++events_waiting_;
    bytes_waiting_ += durable.size_bytes;
    queue_.emplace_back(std::move(durable));
  }
  wake_.NotifyAll();
}

void Applier::Post(Task task) {
  {
    const MutexLock lock(mutex_);
    if (!ended_) {
      queue_.emplace_back(std::move(task));
      wake_.NotifyAll();
      return;
    }
  }
  task(nullptr);
}

void Applier::WaitForRoom() {
  const MutexLock lock(mutex_);
  while (!stopping_ && (events_waiting_ >= limits_.unapplied_events_max ||
                        bytes_waiting_ >= limits_.unapplied_bytes_max)) {
    room_.Wait(mutex_);
  }
}

void Applier::RequestStop() {
  const MutexLock lock(mutex_);
  stopping_ = true;
  wake_.NotifyAll();
  room_.NotifyAll();
}

ApplierCounts Applier::Counts() const {
  const MutexLock lock(mutex_);
  return {.events_waiting = events_waiting_, .closures = closures_, .digests = digests_};
}

const std::string& Applier::StateDigest() {
  if (digest_of_ != engine_.last_event()) {
    state_digest_ = engine_.StateDigest().ToHex();
    digest_of_ = engine_.last_event();
    const MutexLock lock(mutex_);
    ++digests_;
  }
  return state_digest_;
}

Applier::NextStep Applier::WaitForStep() {
  const MutexLock lock(mutex_);
  for (;;) {
    if (stopping_) {
      return Stop{};
    }
    const steady_clock::duration age = steady_clock::now() - published_at_;
    if (!queue_.empty()) {
      if (changed_ && age >= limits_.publish_interval_max) {
        return Publish{};
      }
      Work work = std::move(queue_.front());
      queue_.pop_front();
      return std::visit([](auto&& alternative) -> NextStep { return std::move(alternative); },
                        std::move(work));
    }
    if (!changed_) {
      wake_.Wait(mutex_);
    } else if (age >= limits_.publish_interval_min ||
               !wake_.WaitUntil(mutex_, published_at_ + limits_.publish_interval_min)) {
      if (queue_.empty() && !stopping_) {
        return Publish{};
      }
    }
  }
}

void Applier::ApplyEvent(const DurableEvent& durable) {
  const steady_clock::time_point begin = steady_clock::now();
  const Effects effects = engine_.Apply(durable.event);
  const std::chrono::duration<double, std::milli> wall_time = steady_clock::now() - begin;
  LOCI_CHECK(engine_.last_event() == durable.number);
  changed_ = true;
  everything_moved_ = everything_moved_ || effects.closure_accepted;
  checkpointer_.CountEvent(durable.size_bytes);
  WriteCheckpointIfDue();
  const MutexLock lock(mutex_);
  --events_waiting_;
  bytes_waiting_ -= durable.size_bytes;
  if (effects.closure_accepted) {
    ++closures_.events;
    closures_.last_ms = wall_time.count();
    closures_.max_ms = std::max(closures_.max_ms, wall_time.count());
    closures_.total_ms += wall_time.count();
    closures_.last_places_moved = effects.places_moved;
  }
  room_.NotifyAll();
}

void Applier::WriteCheckpointIfDue() {
  if (checkpointer_.IsDue()) {
    checkpointer_.Begin(engine_, StateDigest());
    engine_.ForgetChangesUpTo(checkpointer_.last_written());
  }
}

void Applier::PublishIfChanged() {
  if (!changed_) {
    return;
  }
  publisher_.Publish(engine_.TakeSnapshot(), everything_moved_);
  published_at_ = steady_clock::now();
  changed_ = false;
  everything_moved_ = false;
}

void Applier::DropQueue() {
  std::deque<Work> dropped;
  {
    const MutexLock lock(mutex_);
    ended_ = true;
    dropped.swap(queue_);
    events_waiting_ = 0;
    bytes_waiting_ = 0;
  }
  for (const Work& work : dropped) {
    if (const auto* task = std::get_if<Task>(&work); task != nullptr) {
      (*task)(nullptr);
    }
  }
}

}  // namespace loci
