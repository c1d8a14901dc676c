// SPDX-License-Identifier: Apache-2.0
// Calls to a Loci server.
#include "clients/cpp/channel.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <thread>
#include <vector>

#include "clients/cpp/pending_call.h"
#include "clients/cpp/stream_state.h"
#include "loci/v1/envelope.pb.h"

namespace loci::client {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;
using std::chrono::milliseconds;

constexpr std::uint32_t kStatusCodeMax = 16;
// Again after this, when the link takes nothing.
constexpr milliseconds kSendRetry{5};
constexpr milliseconds kWaitMax{10'000};

}  // namespace

class Channel::Impl : public std::enable_shared_from_this<Channel::Impl> {
 public:
  Impl(std::string endpoint, ChannelOptions options)
      : endpoint_(std::move(endpoint)),
        options_(std::move(options)),
        link_(options_.link_factory(endpoint_)) {}

  void Start() {
    thread_ = std::thread([this] { Run(); });
  }
  void Stop();
  std::uint64_t Submit(PendingCall call);
  void Cancel(std::uint64_t call_id);
  void Wake() { link_->Wake(); }
  const std::string& endpoint() const { return endpoint_; }

 private:
  enum class State { kClosed, kConnecting, kReady };

  void Run();
  bool TakeCommands();
  void ExpireCalls(SteadyTime now);
  void KeepConnected(SteadyTime now);
  void SendRequests(SteadyTime now);
  void KeepAlive(SteadyTime now);
  milliseconds WaitTime(SteadyTime now) const;
  bool WantsMessages() const;
  void OnEvent(LinkEvent event);
  void OnMessage(LinkEvent event);
  void OnRefused(const std::string& reason);
  void OnLost(const std::string& reason);
  void AddToStream(std::uint64_t call_id, PendingCall& call, std::string body);
  void EndCall(std::uint64_t call_id, const Status& status);
  std::string Where(const PendingCall& call) const { return call.method + " on " + endpoint_; }

  const std::string endpoint_;
  const ChannelOptions options_;
  const std::unique_ptr<Link> link_;
  std::thread thread_;

  std::mutex mutex_;
  bool stopping_ = false;
  std::uint64_t last_call_id_ = 0;
  std::vector<std::pair<std::uint64_t, PendingCall>> submitted_;
  std::vector<std::uint64_t> cancelled_;

  // Of the thread:
  State state_ = State::kClosed;
  std::map<std::uint64_t, PendingCall> calls_;  // in the order of submission
  bool has_unsent_ = false;
  SteadyTime connect_until_;
  SteadyTime next_attempt_;
  milliseconds backoff_{0};
  std::string last_refusal_;
  SteadyTime heard_;
  SteadyTime pinged_;
};

void Channel::Impl::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  link_->Wake();
  if (thread_.joinable()) {
    thread_.join();
  }
}

std::uint64_t Channel::Impl::Submit(PendingCall call) {
  if (call.options.timeout.count() > 0) {
    call.deadline = std::chrono::steady_clock::now() + call.options.timeout;
  }
  {
    const std::lock_guard lock(mutex_);
    if (!stopping_) {
      submitted_.emplace_back(++last_call_id_, std::move(call));
      link_->Wake();
      return last_call_id_;
    }
  }
  Complete(std::move(call), CancelledError("the channel to " + endpoint_ + " is closed"));
  return 0;
}

void Channel::Impl::Cancel(std::uint64_t call_id) {
  {
    const std::lock_guard lock(mutex_);
    cancelled_.push_back(call_id);
  }
  link_->Wake();
}

void Channel::Impl::Run() {
  while (TakeCommands()) {
    const SteadyTime now = std::chrono::steady_clock::now();
    ExpireCalls(now);
    KeepConnected(now);
    SendRequests(now);
    LinkEvent event = link_->Wait(WaitTime(now), WantsMessages());
    if (event.kind == LinkEvent::Kind::kNothing) {
      // Only now: what came while this thread could not run has been read first.
      KeepAlive(std::chrono::steady_clock::now());
    }
    OnEvent(std::move(event));
  }
  link_->Close();
  std::map<std::uint64_t, PendingCall> rest;
  rest.swap(calls_);
  {
    const std::lock_guard lock(mutex_);
    for (auto& [call_id, call] : submitted_) {
      rest.emplace(call_id, std::move(call));
    }
    submitted_.clear();
  }
  for (auto& [call_id, call] : rest) {
    Complete(std::move(call), CancelledError("the channel to " + endpoint_ + " was closed"));
  }
}

// False when the channel is to stop.
bool Channel::Impl::TakeCommands() {
  std::vector<std::pair<std::uint64_t, PendingCall>> submitted;
  std::vector<std::uint64_t> cancelled;
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) {
      return false;
    }
    submitted.swap(submitted_);
    cancelled.swap(cancelled_);
  }
  for (auto& [call_id, call] : submitted) {
    has_unsent_ = true;
    if (!call.options.wait_for_ready) {
      next_attempt_ = {};  // it is to know now
    }
    calls_.emplace(call_id, std::move(call));
  }
  for (const std::uint64_t call_id : cancelled) {
    const auto found = calls_.find(call_id);
    if (found != calls_.end()) {
      if (found->second.sent) {
        link_->Send(Envelope(v1::FRAME_KIND_CANCEL, call_id), {});
      }
      EndCall(call_id, CancelledError(Where(found->second) + ": cancelled"));
    }
  }
  return true;
}

void Channel::Impl::ExpireCalls(SteadyTime now) {
  std::vector<std::pair<std::uint64_t, Status>> expired;
  for (const auto& [call_id, call] : calls_) {
    if (!call.deadline.has_value() || *call.deadline > now) {
      continue;
    }
    const std::string waited = std::to_string(call.options.timeout.count() / 1000) + " ms";
    if (call.sent) {
      link_->Send(Envelope(v1::FRAME_KIND_CANCEL, call_id), {});
      expired.emplace_back(call_id,
                           DeadlineExceededError(Where(call) + ": no answer within " + waited));
    } else {
      expired.emplace_back(
          call_id,
          UnavailableError(Where(call) + ": no connection within " + waited + "; " +
                           (last_refusal_.empty() ? "nothing answers there" : last_refusal_) +
                           "; is locid running there?"));
    }
  }
  for (const auto& [call_id, status] : expired) {
    EndCall(call_id, status);
  }
}

void Channel::Impl::KeepConnected(SteadyTime now) {
  if (state_ == State::kConnecting && now >= connect_until_) {
    link_->Close();
    OnRefused("no connection within " + std::to_string(options_.connect_max.count()) + " ms");
  }
  if (state_ == State::kClosed && has_unsent_ && !calls_.empty() && now >= next_attempt_) {
    state_ = State::kConnecting;
    connect_until_ = now + options_.connect_max;
    link_->Open();
  }
}

void Channel::Impl::SendRequests(SteadyTime now) {
  if (state_ != State::kReady || !has_unsent_) {
    return;
  }
  for (auto& [call_id, call] : calls_) {
    if (!call.sent) {
      if (!link_->Send(RequestEnvelope(call_id, call, now), call.body)) {
        return;
      }
      call.sent = true;
      call.body = {};
    }
  }
  has_unsent_ = false;
}

void Channel::Impl::KeepAlive(SteadyTime now) {
  if (state_ != State::kReady) {
    return;
  }
  if (!WantsMessages()) {
    heard_ = now;  // it may speak: we do not listen
  }
  const bool waits_for_pong = pinged_ > heard_;
  if (waits_for_pong && now - pinged_ >= options_.gone_after - options_.ping_after) {
    link_->Close();
    OnLost("the server has said nothing for " + std::to_string(options_.gone_after.count()) +
           " ms");
    return;
  }
  if (!waits_for_pong && now - heard_ >= options_.ping_after) {
    link_->Send(Envelope(v1::FRAME_KIND_PING, 0), {});
    pinged_ = now;
  }
}

milliseconds Channel::Impl::WaitTime(SteadyTime now) const {
  SteadyTime until = now + kWaitMax;
  for (const auto& [call_id, call] : calls_) {
    if (call.deadline.has_value()) {
      until = std::min(until, *call.deadline);
    }
  }
  if (state_ == State::kConnecting) {
    until = std::min(until, connect_until_);
  } else if (state_ == State::kReady) {
    until = std::min(until,
                     pinged_ > heard_ ? pinged_ + options_.gone_after - options_.ping_after
                                      : heard_ + options_.ping_after);
    if (has_unsent_) {
      until = std::min(until, now + kSendRetry);
    }
  } else if (has_unsent_) {
    until = std::min(until, std::max(next_attempt_, now));
  }
  return std::max(std::chrono::ceil<milliseconds>(until - now), milliseconds(0));
}

// False while only streams are open whose readers have fallen behind: the messages then wait in the
// network, and the server with them.
bool Channel::Impl::WantsMessages() const {
  return calls_.empty() || std::any_of(calls_.begin(), calls_.end(), [this](const auto& entry) {
           const PendingCall& call = entry.second;
           return call.stream == nullptr ||
                  call.stream->unread_bytes() < options_.stream_pause_bytes;
         });
}

void Channel::Impl::OnEvent(LinkEvent event) {
  switch (event.kind) {
    case LinkEvent::Kind::kNothing:
      return;
    case LinkEvent::Kind::kConnected:
      state_ = State::kReady;
      backoff_ = milliseconds(0);
      last_refusal_.clear();
      heard_ = std::chrono::steady_clock::now();
      pinged_ = heard_;
      return;
    case LinkEvent::Kind::kMessage:
      heard_ = std::chrono::steady_clock::now();
      OnMessage(std::move(event));
      return;
    case LinkEvent::Kind::kLost:
      OnLost(event.reason);
      return;
    case LinkEvent::Kind::kRefused:
      OnRefused(event.reason);
      return;
  }
}

void Channel::Impl::OnRefused(const std::string& reason) {
  state_ = State::kClosed;
  last_refusal_ = reason;
  backoff_ = std::clamp(backoff_ * 2, options_.backoff_min, options_.backoff_max);
  next_attempt_ = std::chrono::steady_clock::now() + backoff_;
  std::vector<std::pair<std::uint64_t, Status>> failed;
  for (const auto& [call_id, call] : calls_) {
    if (!call.options.wait_for_ready) {
      failed.emplace_back(
          call_id, UnavailableError(Where(call) + ": " + reason + "; is locid running there?"));
    }
  }
  for (const auto& [call_id, status] : failed) {
    EndCall(call_id, status);
  }
}

void Channel::Impl::OnLost(const std::string& reason) {
  state_ = State::kClosed;
  next_attempt_ = {};
  std::vector<std::pair<std::uint64_t, Status>> failed;
  for (const auto& [call_id, call] : calls_) {
    if (call.sent) {
      failed.emplace_back(call_id,
                          UnavailableError(Where(call) + ": " + reason +
                                           "; it is not known whether the call was done"));
    }
  }
  for (const auto& [call_id, status] : failed) {
    EndCall(call_id, status);
  }
}

void Channel::Impl::OnMessage(LinkEvent event) {
  v1::Envelope envelope;
  if (!envelope.ParseFromString(event.envelope)) {
    return;
  }
  if (envelope.kind() == v1::FRAME_KIND_PING) {
    link_->Send(Envelope(v1::FRAME_KIND_PONG, envelope.call_id()), {});
    return;
  }
  const auto found = calls_.find(envelope.call_id());
  if (found == calls_.end() || !found->second.sent) {
    return;  // a pong, or of a call that has ended here
  }
  PendingCall& call = found->second;
  if (envelope.kind() == v1::FRAME_KIND_RESPONSE) {
    if (call.stream != nullptr) {
      AddToStream(envelope.call_id(), call, std::move(event.body));
    } else {
      call.response = std::move(event.body);
    }
  } else if (envelope.kind() == v1::FRAME_KIND_END) {
    const StatusCode code = envelope.status_code() <= kStatusCodeMax
                                ? static_cast<StatusCode>(envelope.status_code())
                                : StatusCode::kUnknown;
    EndCall(envelope.call_id(), Status(code, envelope.status_message()));
  }
}

void Channel::Impl::AddToStream(std::uint64_t call_id, PendingCall& call, std::string body) {
  call.stream->Push(std::move(body));
  if (call.stream->unread_bytes() > options_.stream_unread_max_bytes) {
    link_->Send(Envelope(v1::FRAME_KIND_CANCEL, call_id), {});
    EndCall(call_id,
            ResourceExhaustedError(Where(call) + ": the reader is " +
                                   std::to_string(call.stream->unread_bytes()) +
                                   " bytes behind; read faster, or by a channel of its own"));
  }
}

void Channel::Impl::EndCall(std::uint64_t call_id, const Status& status) {
  auto node = calls_.extract(call_id);
  if (!node.empty()) {
    Complete(std::move(node.mapped()), status);
  }
}

Channel::Channel(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {
  impl_->Start();
}

Channel::~Channel() {
  impl_->Stop();
}

std::shared_ptr<Channel> Channel::Create(std::string endpoint, ChannelOptions options) {
  return std::shared_ptr<Channel>(
      new Channel(std::make_shared<Impl>(std::move(endpoint), std::move(options))));
}

const std::string& Channel::endpoint() const {
  return impl_->endpoint();
}

StatusOr<std::string> Channel::CallRaw(std::string_view method,
                                       std::string body,
                                       const CallOptions& options) {
  // Shared: the channel's thread may still be inside the promise when this one has its answer.
  auto promise = std::make_shared<std::promise<StatusOr<std::string>>>();
  std::future<StatusOr<std::string>> future = promise->get_future();
  CallRawAsync(method, std::move(body), options, [promise](StatusOr<std::string> response) {
    promise->set_value(std::move(response));
  });
  return future.get();
}

CallHandle Channel::CallRawAsync(std::string_view method,
                                 std::string body,
                                 const CallOptions& options,
                                 RawCallback callback) {
  PendingCall call;
  call.method = method;
  call.body = std::move(body);
  call.options = options;
  call.callback = std::move(callback);
  const std::uint64_t call_id = impl_->Submit(std::move(call));
  return CallHandle([weak = std::weak_ptr<Impl>(impl_), call_id] {
    if (const std::shared_ptr<Impl> impl = weak.lock()) {
      impl->Cancel(call_id);
    }
  });
}

RawStream Channel::StreamRaw(std::string_view method,
                             std::string body,
                             const CallOptions& options) {
  PendingCall call;
  call.method = method;
  call.body = std::move(body);
  call.options = options;
  auto state = std::make_shared<StreamState>();
  call.stream = state;
  auto call_id = std::make_shared<std::atomic<std::uint64_t>>(0);
  const std::weak_ptr<Impl> weak = impl_;
  state->Connect(
      [weak] {
        if (const std::shared_ptr<Impl> impl = weak.lock()) {
          impl->Wake();
        }
      },
      [weak, call_id] {
        if (const std::shared_ptr<Impl> impl = weak.lock()) {
          impl->Cancel(call_id->load());
        }
      });
  call_id->store(impl_->Submit(std::move(call)));
  return RawStream(std::move(state));
}

}  // namespace loci::client
