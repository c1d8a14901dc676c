// SPDX-License-Identifier: Apache-2.0
// One run of one robot: observations in, corrections out; nothing lost, nothing twice.
#include "clients/cpp/mapping_session.h"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>

namespace loci::client {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;
using std::chrono::milliseconds;

constexpr std::size_t kRefusalsKeptMax = 1000;
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

struct Batch {
  v1::AppendBatchRequest request;
  std::uint64_t last_number = 0;
  bool in_flight = false;
  bool answered = false;  // well or badly
  Status status;
};

// What the session's threads and the callbacks of its calls share. Callbacks may come after the
// session's end, so they hold it.
struct Shared {
  std::mutex mutex;
  std::condition_variable changed;
  bool stopping = false;
  Status failure;  // final

  std::vector<v1::Observation> waiting;  // for a batch
  std::size_t waiting_bytes = 0;
  SteadyTime waiting_since;
  bool flushing = false;

  std::deque<Batch> batches;  // sent or to be sent, not durable, in order
  std::size_t in_flight = 0;
  MappingProgress progress;
  std::vector<Refusal> refusals;

  // With the mutex held:
  void DropDurable() {
    while (!batches.empty() && !batches.front().in_flight &&
           batches.front().last_number <= progress.last_durable_number) {
      batches.pop_front();
    }
  }
  void OnAnswer(std::uint64_t first_number, const StatusOr<v1::AppendBatchResponse>& answer);
  void TakeAnswer(const v1::AppendBatchResponse& answer);
};

void Shared::TakeAnswer(const v1::AppendBatchResponse& answer) {
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

void Shared::OnAnswer(std::uint64_t first_number, const StatusOr<v1::AppendBatchResponse>& answer) {
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
  const std::shared_ptr<Shared> shared_ = std::make_shared<Shared>();
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
    const std::lock_guard lock(shared_->mutex);
    shared_->stopping = true;
  }
  shared_->changed.notify_all();
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
  std::unique_lock lock(shared_->mutex);
  if (shared_->changed.wait_for(lock, duration, [this] { return shared_->stopping; })) {
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
      shared_->progress.last_durable_number = state->last_durable_number();
      shared_->progress.last_appended_number = state->last_durable_number();
      shared_->progress.map_from_odom = state->map_from_odom();
      shared_->progress.revision = state->revision();
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
  const std::lock_guard lock(shared_->mutex);
  return shared_->progress.last_appended_number + 1;
}

Status MappingSession::Impl::Append(v1::Observation observation) {
  const std::size_t size = observation.ByteSizeLong();
  {
    std::unique_lock lock(shared_->mutex);
    shared_->changed.wait(lock, [this] {
      return !shared_->failure.ok() || (shared_->waiting.size() < options_.batch_observations_max &&
                                        shared_->waiting_bytes < options_.batch_bytes_max);
    });
    if (!shared_->failure.ok()) {
      return shared_->failure;
    }
    if (shared_->waiting.empty()) {
      shared_->waiting_since = Now();
    }
    shared_->waiting.push_back(std::move(observation));
    shared_->waiting_bytes += size;
    ++shared_->progress.last_appended_number;
  }
  shared_->changed.notify_all();
  return {};
}

Status MappingSession::Impl::Flush() {
  std::unique_lock lock(shared_->mutex);
  shared_->flushing = true;
  shared_->changed.notify_all();
  shared_->changed.wait(lock, [this] {
    return !shared_->failure.ok() || (shared_->waiting.empty() && shared_->batches.empty());
  });
  shared_->flushing = false;
  return shared_->failure;
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
      const std::lock_guard lock(shared_->mutex);
      ++shared_->progress.interruptions;
    }
    LOCI_RETURN_IF_ERROR(Wait(backoff));
    backoff = std::min(backoff * 2, kBackoffMax);
  }
}

MappingProgress MappingSession::Impl::progress() const {
  const std::lock_guard lock(shared_->mutex);
  return shared_->progress;
}

std::vector<Refusal> MappingSession::Impl::TakeRefusals() {
  const std::lock_guard lock(shared_->mutex);
  return std::exchange(shared_->refusals, {});
}

void MappingSession::Impl::Run() {
  std::unique_lock lock(shared_->mutex);
  while (!shared_->stopping && shared_->failure.ok()) {
    if (FirstFailed() != nullptr) {
      if (shared_->in_flight == 0) {
        Recover(lock);
      } else {
        // The others' answers tell which number is the first that is missing.
        shared_->changed.wait(lock);
      }
      continue;
    }
    if (SendNext(lock)) {
      continue;
    }
    if (shared_->waiting.empty() || shared_->batches.size() >= options_.window_batches) {
      shared_->changed.wait(lock);
    } else {
      shared_->changed.wait_until(lock, shared_->waiting_since + options_.batch_delay);
    }
  }
}

const Batch* MappingSession::Impl::FirstFailed() const {
  for (const Batch& batch : shared_->batches) {
    if (batch.answered && !batch.status.ok()) {
      return &batch;
    }
  }
  return nullptr;
}

bool MappingSession::Impl::BatchIsDue() const {
  const Shared& shared = *shared_;
  return !shared.waiting.empty() && shared.batches.size() < options_.window_batches &&
         (shared.flushing || shared.batches.empty() ||
          shared.waiting.size() >= options_.batch_observations_max ||
          shared.waiting_bytes >= options_.batch_bytes_max ||
          Now() >= shared.waiting_since + options_.batch_delay);
}

void MappingSession::Impl::MakeBatch() {
  Shared& shared = *shared_;
  Batch batch;
  batch.last_number = shared.progress.last_appended_number;
  batch.request.set_map(options_.map);
  batch.request.set_session(options_.session);
  batch.request.set_first_number(batch.last_number - shared.waiting.size() + 1);
  for (v1::Observation& observation : shared.waiting) {
    *batch.request.add_observations() = std::move(observation);
  }
  shared.waiting.clear();
  shared.waiting_bytes = 0;
  shared.batches.push_back(std::move(batch));
  shared.changed.notify_all();  // there is room for Append
}

// Sends the first batch that was not sent yet, or makes one if it is time. False: nothing to send.
bool MappingSession::Impl::SendNext(std::unique_lock<std::mutex>& lock) {
  const auto unsent = [this] {
    return std::find_if(shared_->batches.begin(), shared_->batches.end(), [](const Batch& batch) {
      return !batch.in_flight && !batch.answered;
    });
  };
  auto batch = unsent();
  if (batch == shared_->batches.end()) {
    if (!BatchIsDue()) {
      return false;
    }
    MakeBatch();
    batch = unsent();
  }
  batch->in_flight = true;
  ++shared_->in_flight;
  const std::uint64_t first_number = batch->request.first_number();
  std::string body = batch->request.SerializeAsString();
  CallOptions options;
  options.timeout = options_.answer_max;
  lock.unlock();
  channel_->CallRawAsync(
      kAppendBatch,
      std::move(body),
      options,
      [shared = shared_, first_number](const StatusOr<std::string>& bytes) {
        if (!bytes.ok()) {
          shared->OnAnswer(first_number, bytes.status());
          return;
        }
        v1::AppendBatchResponse response;
        shared->OnAnswer(first_number,
                         response.ParseFromString(*bytes)
                             ? StatusOr<v1::AppendBatchResponse>(std::move(response))
                             : InternalError("the server's answer is no AppendBatchResponse"));
      });
  lock.lock();
  return true;
}

void MappingSession::Impl::Fail(const Status& status) {
  shared_->failure = status;
  shared_->changed.notify_all();
}

// No batch is in flight and the first that failed says why: finds out what is durable, and sends
// the rest again.
void MappingSession::Impl::Recover(std::unique_lock<std::mutex>& lock) {
  const Status cause = FirstFailed()->status;
  const bool gap = cause.code() == StatusCode::kFailedPrecondition;
  if (!in_trouble_ || shared_->progress.last_durable_number > durable_at_trouble_) {
    in_trouble_ = true;
    trouble_since_ = Now();
    durable_at_trouble_ = shared_->progress.last_durable_number;
    gap_seen_ = false;
    backoff_ = kBackoffMin;
  }
  if ((!MayPass(cause) && !gap) || (gap && gap_seen_) || GivesUp(trouble_since_)) {
    Fail(cause);
    return;
  }
  gap_seen_ = gap;
  ++shared_->progress.interruptions;
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
  Shared& shared = *shared_;
  const std::uint64_t durable = state.last_durable_number();
  if (durable < shared.progress.last_durable_number) {
    Fail(DataLossError("session " + options_.session + ": the server has observations up to " +
                       std::to_string(durable) + ", but had acknowledged " +
                       std::to_string(shared.progress.last_durable_number)));
    return;
  }
  if (!state.open()) {
    Fail(FailedPreconditionError("session " + options_.session +
                                 " was closed by someone else: " + cause.message()));
    return;
  }
  shared.progress.last_durable_number = durable;
  for (Batch& batch : shared.batches) {
    batch.answered = false;
    batch.status = Status();
  }
  shared.DropDurable();
  shared.changed.notify_all();
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
