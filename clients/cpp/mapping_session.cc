// SPDX-License-Identifier: Apache-2.0
// One run of one robot: observations in, corrections out; nothing lost, nothing twice.
#include "clients/cpp/mapping_session.h"

#include <algorithm>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>

#include "clients/cpp/session_backlog.h"

namespace loci::client {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;
using std::chrono::milliseconds;

constexpr milliseconds kBackoffMin{50};
constexpr milliseconds kBackoffMax{2'000};
// One attempt to reach the server; several fit into retry_for.
constexpr milliseconds kAttemptMax{5'000};

constexpr std::string_view kOpenSession = "loci.v1.Mapping/OpenSession";
constexpr std::string_view kAppendBatch = "loci.v1.Mapping/AppendBatch";
constexpr std::string_view kGetSession = "loci.v1.Mapping/GetSession";
constexpr std::string_view kCloseSession = "loci.v1.Mapping/CloseSession";

SteadyTime Now() {
  return std::chrono::steady_clock::now();
}

// The server is away, has no room, or gave the call up: the same call may succeed later.
bool MayPass(const Status& status) {
  switch (status.code()) {
    case StatusCode::kUnavailable:
    case StatusCode::kDeadlineExceeded:
    case StatusCode::kResourceExhausted:
    case StatusCode::kAborted:
    case StatusCode::kCancelled:
      return true;
    default:
      return false;
  }
}

CallOptions Attempt(milliseconds timeout) {
  CallOptions options;
  options.timeout = timeout;
  options.wait_for_ready = true;
  return options;
}

}  // namespace

class MappingSession::Impl {
 public:
  Impl(std::shared_ptr<Channel> channel, MappingSessionOptions options)
      : channel_(std::move(channel)), options_(std::move(options)) {}
  ~Impl();

  Status Open();
  std::uint64_t next_number() const;
  Status Append(v1::Observation observation);
  Status Flush();
  StatusOr<v1::SessionState> Close();
  MappingProgress progress() const;
  std::vector<Refusal> TakeRefusals();

 private:
  void Run();
  // With the lock held; they may give it back for a while.
  bool SendNext(std::unique_lock<std::mutex>& lock);
  void MakeBatch();
  bool BatchIsDue() const;
  const Batch* FirstFailed() const;
  void Recover(std::unique_lock<std::mutex>& lock);
  void Resume(const v1::SessionState& state, const Status& cause);
  void Fail(const Status& status);

  Status Wait(milliseconds duration);
  void Report(const Status& status) const;
  bool GivesUp(SteadyTime since) const { return Now() - since >= options_.retry_for; }

  const std::shared_ptr<Channel> channel_;
  const MappingSessionOptions options_;
  const std::shared_ptr<SessionBacklog> backlog_ = std::make_shared<SessionBacklog>();
  std::thread thread_;

  // Of the thread: the present series of failures without progress.
  bool in_trouble_ = false;
  SteadyTime trouble_since_;
  std::uint64_t durable_at_trouble_ = 0;
  bool gap_seen_ = false;
  milliseconds backoff_{0};
};

MappingSession::Impl::~Impl() {
  {
    const std::lock_guard lock(backlog_->mutex);
    backlog_->stopping = true;
  }
  backlog_->changed.notify_all();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void MappingSession::Impl::Report(const Status& status) const {
  if (options_.on_trouble) {
    options_.on_trouble(status.ToString());
  }
}

// Not OK when the session ends meanwhile.
Status MappingSession::Impl::Wait(milliseconds duration) {
  std::unique_lock lock(backlog_->mutex);
  if (backlog_->changed.wait_for(lock, duration, [this] { return backlog_->stopping; })) {
    return CancelledError("the session object was destroyed");
  }
  return {};
}

Status MappingSession::Impl::Open() {
  v1::OpenSessionRequest request;
  request.set_map(options_.map);
  request.set_session(options_.session);
  request.set_robot(options_.robot);
  if (options_.map_from_start.has_value()) {
    *request.mutable_map_from_start() = *options_.map_from_start;
  }
  const SteadyTime since = Now();
  milliseconds backoff = kBackoffMin;
  CallOptions attempt = Attempt(std::min(kAttemptMax, options_.retry_for));
  if (options_.retry_for <= milliseconds::zero()) {
    attempt.timeout = kAttemptMax;  // zero would be none
    attempt.wait_for_ready = false;
  }
  while (true) {
    const StatusOr<v1::SessionState> state =
        channel_->Call<v1::SessionState>(kOpenSession, request, attempt);
    if (state.ok()) {
      backlog_->progress.last_durable_number = state->last_durable_number();
      backlog_->progress.last_appended_number = state->last_durable_number();
      backlog_->progress.map_from_odom = state->map_from_odom();
      backlog_->progress.revision = state->revision();
      break;
    }
    if (!MayPass(state.status()) || GivesUp(since)) {
      return state.status();
    }
    Report(state.status());
    LOCI_RETURN_IF_ERROR(Wait(backoff));
    backoff = std::min(backoff * 2, kBackoffMax);
  }
  thread_ = std::thread([this] { Run(); });
  return {};
}

std::uint64_t MappingSession::Impl::next_number() const {
  const std::lock_guard lock(backlog_->mutex);
  return backlog_->progress.last_appended_number + 1;
}

Status MappingSession::Impl::Append(v1::Observation observation) {
  const std::size_t size = observation.ByteSizeLong();
  {
    std::unique_lock lock(backlog_->mutex);
    backlog_->changed.wait(lock, [this] {
      return !backlog_->failure.ok() ||
             (backlog_->waiting.size() < options_.batch_observations_max &&
              backlog_->waiting_bytes < options_.batch_bytes_max);
    });
    if (!backlog_->failure.ok()) {
      return backlog_->failure;
    }
    if (backlog_->waiting.empty()) {
      backlog_->waiting_since = Now();
    }
    backlog_->waiting.push_back(std::move(observation));
    backlog_->waiting_bytes += size;
    ++backlog_->progress.last_appended_number;
  }
  backlog_->changed.notify_all();
  return {};
}

Status MappingSession::Impl::Flush() {
  std::unique_lock lock(backlog_->mutex);
  backlog_->flushing = true;
  backlog_->changed.notify_all();
  backlog_->changed.wait(lock, [this] {
    return !backlog_->failure.ok() || (backlog_->waiting.empty() && backlog_->batches.empty());
  });
  backlog_->flushing = false;
  return backlog_->failure;
}

StatusOr<v1::SessionState> MappingSession::Impl::Close() {
  LOCI_RETURN_IF_ERROR(Flush());
  v1::CloseSessionRequest request;
  request.set_map(options_.map);
  request.set_session(options_.session);
  const SteadyTime until = Now() + options_.close_max;
  std::optional<SteadyTime> trouble_since;
  milliseconds backoff = kBackoffMin;
  while (true) {
    const SteadyTime begin = Now();
    // Does not wait for a server that is away: the call may take as long as close_max, the wait may
    // not.
    CallOptions options;
    options.timeout = std::chrono::ceil<milliseconds>(until - begin);
    StatusOr<v1::SessionState> state =
        channel_->Call<v1::SessionState>(kCloseSession, request, options);
    if (state.ok() || !MayPass(state.status()) || Now() >= until) {
      return state;
    }
    // After more time than an attempt to connect takes, the server had been at work: only now it
    // went away.
    if (!trouble_since.has_value() || Now() - begin > 2 * kAttemptMax) {
      trouble_since = Now();
      backoff = kBackoffMin;
    }
    if (GivesUp(*trouble_since)) {
      return state;
    }
    Report(state.status());
    {
      const std::lock_guard lock(backlog_->mutex);
      ++backlog_->progress.interruptions;
    }
    LOCI_RETURN_IF_ERROR(Wait(backoff));
    backoff = std::min(backoff * 2, kBackoffMax);
  }
}

MappingProgress MappingSession::Impl::progress() const {
  const std::lock_guard lock(backlog_->mutex);
  return backlog_->progress;
}

std::vector<Refusal> MappingSession::Impl::TakeRefusals() {
  const std::lock_guard lock(backlog_->mutex);
  return std::exchange(backlog_->refusals, {});
}

void MappingSession::Impl::Run() {
  std::unique_lock lock(backlog_->mutex);
  while (!backlog_->stopping && backlog_->failure.ok()) {
    if (FirstFailed() != nullptr) {
      if (backlog_->in_flight == 0) {
        Recover(lock);
      } else {
        // The others' answers tell which number is the first that is missing.
        backlog_->changed.wait(lock);
      }
      continue;
    }
    if (SendNext(lock)) {
      continue;
    }
    if (backlog_->waiting.empty() || backlog_->batches.size() >= options_.window_batches) {
      backlog_->changed.wait(lock);
    } else {
      backlog_->changed.wait_until(lock, backlog_->waiting_since + options_.batch_delay);
    }
  }
}

const Batch* MappingSession::Impl::FirstFailed() const {
  for (const Batch& batch : backlog_->batches) {
    if (batch.answered && !batch.status.ok()) {
      return &batch;
    }
  }
  return nullptr;
}

bool MappingSession::Impl::BatchIsDue() const {
  const SessionBacklog& backlog = *backlog_;
  return !backlog.waiting.empty() && backlog.batches.size() < options_.window_batches &&
         (backlog.flushing || backlog.batches.empty() ||
          backlog.waiting.size() >= options_.batch_observations_max ||
          backlog.waiting_bytes >= options_.batch_bytes_max ||
          Now() >= backlog.waiting_since + options_.batch_delay);
}

void MappingSession::Impl::MakeBatch() {
  SessionBacklog& backlog = *backlog_;
  Batch batch;
  batch.last_number = backlog.progress.last_appended_number;
  batch.request.set_map(options_.map);
  batch.request.set_session(options_.session);
  batch.request.set_first_number(batch.last_number - backlog.waiting.size() + 1);
  for (v1::Observation& observation : backlog.waiting) {
    *batch.request.add_observations() = std::move(observation);
  }
  backlog.waiting.clear();
  backlog.waiting_bytes = 0;
  backlog.batches.push_back(std::move(batch));
  backlog.changed.notify_all();  // there is room for Append
}

// Sends the first batch that was not sent yet, or makes one if it is time. False: nothing to send.
bool MappingSession::Impl::SendNext(std::unique_lock<std::mutex>& lock) {
  const auto unsent = [this] {
    return std::find_if(backlog_->batches.begin(), backlog_->batches.end(), [](const Batch& batch) {
      return !batch.in_flight && !batch.answered;
    });
  };
  auto batch = unsent();
  if (batch == backlog_->batches.end()) {
    if (!BatchIsDue()) {
      return false;
    }
    MakeBatch();
    batch = unsent();
  }
  batch->in_flight = true;
  ++backlog_->in_flight;
  const std::uint64_t first_number = batch->request.first_number();
  std::string body = batch->request.SerializeAsString();
  CallOptions options;
  options.timeout = options_.answer_max;
  lock.unlock();
  channel_->CallRawAsync(
      kAppendBatch,
      std::move(body),
      options,
      [backlog = backlog_, first_number](const StatusOr<std::string>& bytes) {
        if (!bytes.ok()) {
          backlog->OnAnswer(first_number, bytes.status());
          return;
        }
        v1::AppendBatchResponse response;
        backlog->OnAnswer(first_number,
                          response.ParseFromString(*bytes)
                              ? StatusOr<v1::AppendBatchResponse>(std::move(response))
                              : InternalError("the server's answer is no AppendBatchResponse"));
      });
  lock.lock();
  return true;
}

void MappingSession::Impl::Fail(const Status& status) {
  backlog_->failure = status;
  backlog_->changed.notify_all();
}

// No batch is in flight and the first that failed says why: finds out what is durable, and sends
// the rest again.
void MappingSession::Impl::Recover(std::unique_lock<std::mutex>& lock) {
  const Status cause = FirstFailed()->status;
  const bool gap = cause.code() == StatusCode::kFailedPrecondition;
  if (!in_trouble_ || backlog_->progress.last_durable_number > durable_at_trouble_) {
    in_trouble_ = true;
    trouble_since_ = Now();
    durable_at_trouble_ = backlog_->progress.last_durable_number;
    gap_seen_ = false;
    backoff_ = kBackoffMin;
  }
  if ((!MayPass(cause) && !gap) || (gap && gap_seen_) || GivesUp(trouble_since_)) {
    Fail(cause);
    return;
  }
  gap_seen_ = gap;
  ++backlog_->progress.interruptions;
  lock.unlock();
  Report(cause);
  v1::GetSessionRequest request;
  request.set_map(options_.map);
  request.set_session(options_.session);
  Status waited = Wait(backoff_);
  backoff_ = std::min(backoff_ * 2, kBackoffMax);
  StatusOr<v1::SessionState> state =
      waited.ok() ? channel_->Call<v1::SessionState>(kGetSession, request, Attempt(kAttemptMax))
                  : StatusOr<v1::SessionState>(waited);
  lock.lock();
  if (state.ok()) {
    Resume(*state, cause);
  } else if (!MayPass(state.status()) || GivesUp(trouble_since_)) {
    Fail(state.status());
  }
  // Else the failed batch is still there, and the next round tries again.
}

void MappingSession::Impl::Resume(const v1::SessionState& state, const Status& cause) {
  SessionBacklog& backlog = *backlog_;
  const std::uint64_t durable = state.last_durable_number();
  if (durable < backlog.progress.last_durable_number) {
    Fail(DataLossError("session " + options_.session + ": the server has observations up to " +
                       std::to_string(durable) + ", but had acknowledged " +
                       std::to_string(backlog.progress.last_durable_number)));
    return;
  }
  if (!state.open()) {
    Fail(FailedPreconditionError("session " + options_.session +
                                 " was closed by someone else: " + cause.message()));
    return;
  }
  backlog.progress.last_durable_number = durable;
  for (Batch& batch : backlog.batches) {
    batch.answered = false;
    batch.status = Status();
  }
  backlog.DropDurable();
  backlog.changed.notify_all();
}

MappingSession::MappingSession(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MappingSession::~MappingSession() = default;

StatusOr<std::unique_ptr<MappingSession>> MappingSession::Open(
    std::shared_ptr<Channel> channel, const MappingSessionOptions& options) {
  auto impl = std::make_unique<Impl>(std::move(channel), options);
  LOCI_RETURN_IF_ERROR(impl->Open());
  return std::unique_ptr<MappingSession>(new MappingSession(std::move(impl)));
}

std::uint64_t MappingSession::next_number() const {
  return impl_->next_number();
}
Status MappingSession::Append(v1::Observation observation) {
  return impl_->Append(std::move(observation));
}
Status MappingSession::Flush() {
  return impl_->Flush();
}
StatusOr<v1::SessionState> MappingSession::Close() {
  return impl_->Close();
}
MappingProgress MappingSession::progress() const {
  return impl_->progress();
}
std::vector<Refusal> MappingSession::TakeRefusals() {
  return impl_->TakeRefusals();
}

}  // namespace loci::client
