// SPDX-License-Identifier: Apache-2.0
// A call as its handler sees it.
#include "server/rpc/call.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <string>
#include <utility>

#include "server/rpc/call_table.h"
#include "server/rpc/counters.h"
#include "server/rpc/frame.h"

namespace loci {

ServerCall::ServerCall(std::shared_ptr<CallTable> table,
                       Request request,
                       std::shared_ptr<PeerAccount> account,
                       MethodCounters& counters)
    : table_(std::move(table)),
      request_(std::move(request)),
      account_(std::move(account)),
      counters_(counters) {
  counters_.request_bytes += request_.size_bytes;
}

void ServerCall::OnOver(std::function<void()> callback) {
  {
    const MutexLock lock(mutex_);
    if (!over()) {
      on_over_.push_back(std::move(callback));
      return;
    }
  }
  callback();
}

void ServerCall::Finish(const Status& status) {
  End(status, nullptr);
}

void ServerCall::FinishWithBody(std::string body) {
  const std::size_t size_max = table_->options().message_max_bytes;
  if (body.size() > size_max) {
    End(ResourceExhaustedError(method() + ": the answer has " + std::to_string(body.size()) +
                               " bytes, more than a message may have (" + std::to_string(size_max) +
                               "); ask for less"),
        nullptr);
  } else if (!table_->ResponseFits(*account_, body.size())) {
    End(ResourceExhaustedError(method() + ": too many answers wait to be read (" +
                               std::to_string(account_->unsent_bytes.load()) +
                               " bytes of this connection); read them and ask again"),
        nullptr);
  } else {
    End(Status(), &body);
  }
}

void ServerCall::End(const Status& status, std::string* body) {
  std::vector<std::function<void()>> callbacks;
  ByteSource dropped;  // destroyed without the lock: it may hold a subscription
  {
    const MutexLock lock(mutex_);
    if (over()) {
      return;
    }
    if (body != nullptr) {
      SendBodyLocked(std::move(*body));
    }
    table_->SendFrom(*this, EndEnvelope(call_id(), status), {}, true);
    over_.store(true, std::memory_order_release);
    callbacks.swap(on_over_);
    if (pump_ == Pump::kIdle) {
      dropped = std::move(source_);
      pump_ = Pump::kNone;
    }
  }
  table_->Remove(*this);
  counters_.calls[static_cast<std::size_t>(status.code())]++;
  const auto duration =
      std::chrono::duration_cast<std::chrono::microseconds>(table_->Now() - request_.arrival);
  counters_.duration_us_sum +=
      static_cast<std::uint64_t>(std::max<std::int64_t>(duration.count(), 0));
  for (const std::function<void()>& callback : callbacks) {
    callback();
  }
}

void ServerCall::SendBodyLocked(std::string body) {
  counters_.response_bytes += body.size();
  counters_.response_messages++;
  const std::size_t size = body.size();
  if (table_->SendFrom(*this, ResponseEnvelope(call_id()), std::move(body), false)) {
    unsent_bytes_ += size;
    ++unsent_messages_;
  }
}

void ServerCall::OnReleased(std::size_t size_bytes) {
  const MutexLock lock(mutex_);
  unsent_bytes_ -= size_bytes;
  --unsent_messages_;
  ScheduleLocked();
}

bool ServerCall::HasRoomLocked() {
  const DispatcherOptions& options = table_->options();
  if (unsent_bytes_ >= options.stream_window_bytes ||
      unsent_messages_ >= options.stream_window_messages) {
    return false;  // OnReleased asks again
  }
  if (!table_->HasRoom(*account_)) {
    table_->NoteStarved();
    return false;
  }
  return true;
}

void ServerCall::StartStream(ByteSource source) {
  const MutexLock lock(mutex_);
  if (over() || pump_ != Pump::kNone) {
    return;
  }
  source_ = std::move(source);
  pump_ = Pump::kIdle;
  wanted_ = true;
  ScheduleLocked();
}

void ServerCall::Wake() {
  const MutexLock lock(mutex_);
  wanted_ = true;
  ScheduleLocked();
}

void ServerCall::ScheduleLocked() {
  if (pump_ == Pump::kIdle && wanted_ && !over() && HasRoomLocked()) {
    pump_ = Pump::kScheduled;
    table_->Post([self = shared_from_this()] { self->RunPump(); });
  }
}

void ServerCall::RunPump() {
  // So many messages, then the others' turn.
  constexpr int kStepsPerTurn = 16;
  {
    const MutexLock lock(mutex_);
    pump_ = Pump::kRunning;
  }
  for (int step = 0; step < kStepsPerTurn && StepPump(); ++step) {
  }
  ByteSource dropped;
  const MutexLock lock(mutex_);
  pump_ = Pump::kIdle;
  if (over()) {
    dropped = std::move(source_);
    pump_ = Pump::kNone;
  }
  ScheduleLocked();
}

// One message. False: not now, or never again.
bool ServerCall::StepPump() {
  {
    const MutexLock lock(mutex_);
    if (over() || !wanted_ || !HasRoomLocked()) {
      return false;
    }
    wanted_ = false;  // before the source is asked, so that no Wake is lost
  }
  std::string body;
  StatusOr<StreamStep> step = StreamStep::kWait;
  try {
    step = source_(body);
  } catch (const std::exception& error) {
    step = InternalError(method() + ": " + error.what());
  }
  const std::size_t size_max = table_->options().message_max_bytes;
  if (!step.ok()) {
    Finish(step.status());
    return false;
  }
  if (*step == StreamStep::kEnd) {
    Finish(Status());
    return false;
  }
  if (*step == StreamStep::kWait) {
    return true;  // unless it was woken meanwhile, the next step ends the turn
  }
  if (body.size() > size_max) {
    Finish(ResourceExhaustedError(method() + ": a message of the stream has " +
                                  std::to_string(body.size()) + " bytes, more than " +
                                  std::to_string(size_max)));
    return false;
  }
  const MutexLock lock(mutex_);
  if (over()) {
    return false;
  }
  wanted_ = true;
  SendBodyLocked(std::move(body));
  return true;
}

}  // namespace loci
