// SPDX-License-Identifier: Apache-2.0
// Messages over one ZeroMQ ROUTER socket.
#include "server/transport/zmq_transport.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <deque>
#include <optional>
#include <thread>
#include <unordered_map>
#include <utility>
#include <vector>

#include <pthread.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <zmq.hpp>

#include "core/base/check.h"
#include "server/base/mutex.h"
#include "server/transport/connection_watch.h"
#include "server/transport/listen_endpoint.h"

namespace loci {
namespace {

// One for the process, never ended: ending a context while another one works has crashed libsodium
// (libzmq #4242), and nothing is left to do at the end of the process.
zmq::context_t& Context() {
  static auto* const context = new zmq::context_t(1);
  return *context;
}

constexpr int kReceiveQueueMessages = 16;
constexpr int kSendQueueMessages = 1000;
constexpr int kRoundMessagesMax = 256;
constexpr std::chrono::milliseconds kWatchInterval{100};
constexpr std::chrono::milliseconds kBlockedRetry{5};
constexpr std::chrono::milliseconds kDrainCheck{2};

// What libzmq holds until the bytes of a body have gone to the system.
struct BodyOnTheWay {
  std::string body;
  std::size_t size_bytes = 0;
  std::function<void()> on_released;
  std::shared_ptr<TransportCounters> counters;
};

void ReleaseBody(void* /*data*/, void* hint) {
  const std::unique_ptr<BodyOnTheWay> way(static_cast<BodyOnTheWay*>(hint));
  way->counters->bytes_unsent -= way->size_bytes;
  if (way->on_released) {
    way->on_released();
  }
}

}  // namespace

class ZmqTransport::Loop {
 public:
  explicit Loop(const ZmqTransportOptions& options);
  ~Loop();

  Status Bind();
  Status Start(TransportSink& sink);
  bool Send(OutgoingMessage message);
  void Wake();
  void Stop(Duration drain);

  const std::string& endpoint() const { return endpoint_; }
  const TransportCounters& counters() const { return *counters_; }

 private:
  enum class Sent { kYes, kNotNow };

  void Configure();
  void Run();
  void Round();
  void Receive();
  void ReadMonitor();
  void CountFrame(zmq::message_t& frame);
  void TransmitOutgoing();
  void RetryBlocked();
  Sent TrySend(OutgoingMessage& message);
  void Drop(OutgoingMessage& message);
  void TellGone();
  bool Finished();
  int WaitMilliseconds(TimePoint now);

  const ZmqTransportOptions options_;
  const std::shared_ptr<TransportCounters> counters_ = std::make_shared<TransportCounters>();
  zmq::socket_t router_;
  zmq::socket_t monitor_;
  const int wake_descriptor_;
  std::string endpoint_;
  TransportSink* sink_ = nullptr;
  std::thread thread_;

  Mutex mutex_;
  std::vector<OutgoingMessage> outgoing_ LOCI_GUARDED_BY(mutex_);
  bool stopping_ LOCI_GUARDED_BY(mutex_) = false;
  TimePoint drain_until_ LOCI_GUARDED_BY(mutex_);

  // Of the loop's thread:
  std::optional<ConnectionWatch> watch_;
  std::unordered_map<PeerId, std::deque<OutgoingMessage>> blocked_;
  std::vector<PeerId> gone_;
  TimePoint next_tick_;
  TimePoint next_watch_;
};

ZmqTransport::Loop::Loop(const ZmqTransportOptions& options)
    : options_(options),
      router_(Context(), zmq::socket_type::router),
      monitor_(Context(), zmq::socket_type::pair),
      wake_descriptor_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  LOCI_CHECK(wake_descriptor_ >= 0);
}

ZmqTransport::Loop::~Loop() {
  Stop(Duration::zero());
  close(wake_descriptor_);
}

void ZmqTransport::Loop::Configure() {
  // ZMQ_HEARTBEAT stays off: in libzmq 4.3.4 it ends the process and loses data without a word.
  router_.set(zmq::sockopt::linger, 0);
  router_.set(zmq::sockopt::router_mandatory, true);
  router_.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(options_.frame_max_bytes));
  router_.set(zmq::sockopt::handshake_ivl, static_cast<int>(options_.handshake_max.count()));
  router_.set(zmq::sockopt::rcvhwm, kReceiveQueueMessages);
  router_.set(zmq::sockopt::sndhwm, kSendQueueMessages);
  router_.set(zmq::sockopt::backlog, 4096);
  router_.set(zmq::sockopt::tcp_keepalive, 1);
  router_.set(zmq::sockopt::tcp_keepalive_idle, 30);
  router_.set(zmq::sockopt::tcp_keepalive_intvl, 10);
  router_.set(zmq::sockopt::tcp_keepalive_cnt, 3);
  router_.set(zmq::sockopt::ipv6, options_.endpoint.find('[') != std::string::npos);
  monitor_.set(zmq::sockopt::linger, 0);
  // Never the address of a transport before, which libzmq may still be closing.
  static std::atomic<std::uint64_t> last_number{0};
  const std::string address = "inproc://loci-router-" + std::to_string(++last_number);
  // ZMQ_EVENT_CLOSED would be of the listening socket only.
  const int rc = zmq_socket_monitor(
      router_.handle(), address.c_str(), ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_DISCONNECTED);
  LOCI_CHECK(rc == 0);
  monitor_.connect(address);
}

Status ZmqTransport::Loop::Bind() {
  int major = 0;
  int minor = 0;
  int patch = 0;
  zmq_version(&major, &minor, &patch);
  if (ZMQ_MAKE_VERSION(major, minor, patch) < ZMQ_MAKE_VERSION(4, 3, 3)) {
    return FailedPreconditionError("libzmq " + std::to_string(major) + "." + std::to_string(minor) +
                                   "." + std::to_string(patch) +
                                   " can be stopped by anyone (CVE-2020-15166): 4.3.3 is needed");
  }
  LOCI_RETURN_IF_ERROR(CheckListenEndpoint(options_.endpoint, true));
  try {
    Configure();
    router_.bind(options_.endpoint);
    endpoint_ = router_.get(zmq::sockopt::last_endpoint);
  } catch (const zmq::error_t& error) {
    const std::string text = "cannot listen on " + options_.endpoint + ": " + error.what();
    return error.num() == EADDRINUSE ? UnavailableError(text + "; is another server running?")
                                     : InvalidArgumentError(text);
  }
  const std::optional<HostAndPort> bound = ParseEndpoint(endpoint_);
  LOCI_CHECK(bound.has_value());
  watch_.emplace(ConnectionLimits{options_.connection_backlog_max_bytes,
                                  options_.total_backlog_max_bytes,
                                  options_.backlog_suspect_bytes,
                                  options_.backlog_growth_max_bytes},
                 bound->port);
  return {};
}

Status ZmqTransport::Loop::Start(TransportSink& sink) {
  sink_ = &sink;
  thread_ = std::thread([this] { Run(); });
  return {};
}

bool ZmqTransport::Loop::Send(OutgoingMessage message) {
  {
    const MutexLock lock(mutex_);
    if (stopping_) {
      return false;
    }
    counters_->bytes_unsent += message.envelope.size() + message.body.size();
    outgoing_.push_back(std::move(message));
    if (outgoing_.size() > 1) {
      return true;  // the loop has been told
    }
  }
  Wake();
  return true;
}

void ZmqTransport::Loop::Wake() {
  const std::uint64_t one = 1;
  // It fails only if the counter is full, and then the loop wakes anyway.
  [[maybe_unused]] const ssize_t written = write(wake_descriptor_, &one, sizeof one);
}

void ZmqTransport::Loop::Stop(Duration drain) {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    drain_until_ = std::chrono::steady_clock::now() + drain;
  }
  if (thread_.joinable()) {
    Wake();
    thread_.join();
  }
}

void ZmqTransport::Loop::Run() {
  // Signals are for the main thread.
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  while (!Finished()) {
    Round();
  }
  for (auto& [peer, messages] : blocked_) {
    for (OutgoingMessage& message : messages) {
      Drop(message);
    }
  }
  blocked_.clear();
  std::vector<OutgoingMessage> rest;
  {
    const MutexLock lock(mutex_);
    rest.swap(outgoing_);
  }
  for (OutgoingMessage& message : rest) {
    Drop(message);
  }
  zmq_socket_monitor(router_.handle(), nullptr, 0);
  monitor_.close();
  router_.close();
}

// True when nothing more is to be done: asked to stop, and all bytes have left or time is over.
bool ZmqTransport::Loop::Finished() {
  const MutexLock lock(mutex_);
  return stopping_ &&
         (counters_->bytes_unsent.load() == 0 || std::chrono::steady_clock::now() >= drain_until_);
}

int ZmqTransport::Loop::WaitMilliseconds(TimePoint now) {
  TimePoint until = std::min(next_tick_, now + std::chrono::seconds(10));
  if (watch_->connection_count() > 0) {
    until = std::min(until, next_watch_);
  }
  if (!blocked_.empty()) {
    until = std::min(until, now + kBlockedRetry);
  }
  {
    const MutexLock lock(mutex_);
    if (stopping_) {
      until = std::min(until, now + kDrainCheck);
    }
    if (!outgoing_.empty()) {
      until = now;
    }
  }
  const auto wait = std::chrono::ceil<std::chrono::milliseconds>(until - now);
  return static_cast<int>(std::max<std::int64_t>(wait.count(), 0));
}

void ZmqTransport::Loop::Round() {
  std::array<zmq::pollitem_t, 3> items{{{router_.handle(), 0, ZMQ_POLLIN, 0},
                                        {monitor_.handle(), 0, ZMQ_POLLIN, 0},
                                        {nullptr, wake_descriptor_, ZMQ_POLLIN, 0}}};
  const TimePoint before = std::chrono::steady_clock::now();
  const std::chrono::milliseconds wait(WaitMilliseconds(before));
  zmq::poll(items.data(), items.size(), wait);
  if ((items[2].revents & ZMQ_POLLIN) != 0) {
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t size = read(wake_descriptor_, &count, sizeof count);
  }
  if ((items[1].revents & ZMQ_POLLIN) != 0) {
    ReadMonitor();
  }
  if ((items[0].revents & ZMQ_POLLIN) != 0) {
    Receive();
  }
  RetryBlocked();
  TransmitOutgoing();
  TellGone();
  const TimePoint now = std::chrono::steady_clock::now();
  next_tick_ = sink_->OnTick(now);
  if (now >= next_watch_) {
    next_watch_ = now + kWatchInterval;
    counters_->connections_cut += watch_->Check(now);
  }
}

void ZmqTransport::Loop::ReadMonitor() {
  zmq::message_t event;
  zmq::message_t address;
  while (monitor_.recv(event, zmq::recv_flags::dontwait).has_value()) {
    LOCI_CHECK(monitor_.recv(address, zmq::recv_flags::dontwait).has_value());
    std::uint16_t kind = 0;
    std::int32_t value = 0;
    LOCI_CHECK(event.size() >= sizeof kind + sizeof value);
    std::memcpy(&kind, event.data(), sizeof kind);
    std::memcpy(&value, event.data<char>() + sizeof kind, sizeof value);
    if (kind == ZMQ_EVENT_ACCEPTED) {
      watch_->OnOpened(value);
    } else {
      watch_->OnClosed(value);
    }
  }
  counters_->connections.store(watch_->connection_count());
}

void ZmqTransport::Loop::CountFrame(zmq::message_t& frame) {
  counters_->bytes_in += frame.size();
  // Which connection it came by. It cannot be told of frames that are still there after a loss.
  const int descriptor = zmq_msg_get(frame.handle(), ZMQ_SRCFD);
  if (descriptor >= 0 && !watch_->OnFrame(descriptor, frame.size())) {
    ReadMonitor();
    watch_->OnFrame(descriptor, frame.size());
  }
}

void ZmqTransport::Loop::Receive() {
  zmq::message_t frame;
  for (int round = 0; round < kRoundMessagesMax; ++round) {
    if (!router_.recv(frame, zmq::recv_flags::dontwait).has_value()) {
      return;
    }
    const PeerId peer = frame.to_string();
    std::array<std::string, 2> content;
    std::size_t frame_count = 0;
    while (frame.more()) {
      LOCI_CHECK(router_.recv(frame, zmq::recv_flags::dontwait).has_value());
      CountFrame(frame);
      if (frame_count < content.size()) {
        content[frame_count].assign(frame.data<char>(), frame.size());
      }
      ++frame_count;
    }
    if (frame_count != content.size()) {
      counters_->messages_ignored++;
      continue;
    }
    counters_->messages_in++;
    sink_->OnMessage(peer, std::move(content[0]), std::move(content[1]));
  }
}

void ZmqTransport::Loop::TransmitOutgoing() {
  std::vector<OutgoingMessage> messages;
  {
    const MutexLock lock(mutex_);
    messages.swap(outgoing_);
  }
  for (OutgoingMessage& message : messages) {
    const auto blocked = blocked_.find(message.peer);
    if (blocked != blocked_.end()) {
      blocked->second.push_back(std::move(message));
    } else if (TrySend(message) == Sent::kNotNow) {
      const PeerId peer = message.peer;
      blocked_[peer].push_back(std::move(message));
    }
  }
}

void ZmqTransport::Loop::RetryBlocked() {
  for (auto it = blocked_.begin(); it != blocked_.end();) {
    std::deque<OutgoingMessage>& messages = it->second;
    while (!messages.empty() && TrySend(messages.front()) == Sent::kYes) {
      messages.pop_front();
    }
    it = messages.empty() ? blocked_.erase(it) : std::next(it);
  }
}

// kYes also if the peer is gone: the message is done with.
ZmqTransport::Loop::Sent ZmqTransport::Loop::TrySend(OutgoingMessage& message) {
  const int more = ZMQ_SNDMORE | ZMQ_DONTWAIT;
  if (zmq_send(router_.handle(), message.peer.data(), message.peer.size(), more) < 0) {
    const int error = zmq_errno();
    if (error == EAGAIN) {
      return Sent::kNotNow;  // this peer's queue is full
    }
    // EHOSTUNREACH: it has left.
    counters_->messages_undeliverable++;
    gone_.push_back(message.peer);
    Drop(message);
    return Sent::kYes;
  }
  // The queue had room for the first frame, so the others are taken too: libzmq counts messages. If
  // the peer leaves meanwhile, libzmq drops them and the next message finds out.
  const std::size_t size = message.envelope.size() + message.body.size();
  zmq_send(router_.handle(), message.envelope.data(), message.envelope.size(), more);
  auto way = std::make_unique<BodyOnTheWay>(
      BodyOnTheWay{std::move(message.body), size, std::move(message.on_released), counters_});
  BodyOnTheWay* const raw = way.release();
  zmq::message_t body(raw->body.data(), raw->body.size(), ReleaseBody, raw);
  router_.send(body, zmq::send_flags::dontwait);
  counters_->messages_out++;
  counters_->bytes_out += size;
  return Sent::kYes;
}

void ZmqTransport::Loop::Drop(OutgoingMessage& message) {
  counters_->bytes_unsent -= message.envelope.size() + message.body.size();
  if (message.on_released) {
    message.on_released();
  }
}

void ZmqTransport::Loop::TellGone() {
  std::vector<PeerId> gone;
  gone.swap(gone_);
  for (const PeerId& peer : gone) {
    sink_->OnPeerGone(peer);
  }
}

ZmqTransport::ZmqTransport(std::unique_ptr<Loop> loop) : loop_(std::move(loop)) {}
ZmqTransport::~ZmqTransport() = default;

StatusOr<std::unique_ptr<ZmqTransport>> ZmqTransport::Listen(const ZmqTransportOptions& options) {
  auto loop = std::make_unique<Loop>(options);
  LOCI_RETURN_IF_ERROR(loop->Bind());
  return std::unique_ptr<ZmqTransport>(new ZmqTransport(std::move(loop)));
}

Status ZmqTransport::Start(TransportSink& sink) {
  return loop_->Start(sink);
}
bool ZmqTransport::Send(OutgoingMessage message) {
  return loop_->Send(std::move(message));
}
void ZmqTransport::Wake() {
  loop_->Wake();
}
void ZmqTransport::Stop(Duration drain) {
  loop_->Stop(drain);
}
std::string ZmqTransport::endpoint() const {
  return loop_->endpoint();
}
const TransportCounters& ZmqTransport::counters() const {
  return loop_->counters();
}

}  // namespace loci
