// SPDX-License-Identifier: Apache-2.0
// A link over ZeroMQ.
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include <sys/eventfd.h>
#include <unistd.h>

#include <zmq.hpp>

#include "clients/cpp/link.h"
#include "core/base/check.h"

namespace loci::client {
namespace {

// One for the process, never ended: a context per channel would start a thread each, and ending one
// while another works has crashed libsodium (libzmq #4242).
zmq::context_t& Context() {
  static auto* const context = new zmq::context_t(1);
  return *context;
}

// A server's largest body and room for its envelope.
constexpr std::int64_t kFrameMaxBytes = (std::int64_t{4} << 20U) + (std::int64_t{64} << 10U);

// Two sockets a connection: the DEALER, and the pair that tells of it. The DEALER does not
// reconnect by itself, because calls that are in flight must hear of a loss.
class ZmqLink : public Link {
 public:
  explicit ZmqLink(std::string endpoint)
      : endpoint_(std::move(endpoint)), wake_descriptor_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    LOCI_CHECK(wake_descriptor_ >= 0);
  }
  ZmqLink(const ZmqLink&) = delete;
  ZmqLink& operator=(const ZmqLink&) = delete;
  ~ZmqLink() override {
    Close();
    close(wake_descriptor_);
  }

  void Open() override;
  void Close() override;
  bool Send(const std::string& envelope, const std::string& body) override;
  LinkEvent Wait(std::chrono::milliseconds timeout, bool read_messages) override;

  void Wake() override {
    const std::uint64_t one = 1;
    // It fails only when the counter is full, and then the link wakes anyway.
    [[maybe_unused]] const ssize_t written = write(wake_descriptor_, &one, sizeof one);
  }

 private:
  void Connect();
  std::optional<LinkEvent> ReadMonitor();
  std::optional<LinkEvent> ReadMessage();
  LinkEvent End(LinkEvent::Kind kind, std::string reason);

  const std::string endpoint_;
  const int wake_descriptor_;
  std::optional<zmq::socket_t> dealer_;
  std::optional<zmq::socket_t> monitor_;
  bool connected_ = false;
  // The connection is gone, but messages that came before may wait in the socket.
  bool lost_ = false;
  std::string refused_;  // why Open failed; told by Wait
};

void ZmqLink::Open() {
  Close();
  try {
    Connect();
  } catch (const zmq::error_t& error) {
    Close();
    refused_ = std::string("cannot connect: ") + error.what();
  }
}

void ZmqLink::Connect() {
  dealer_.emplace(Context(), zmq::socket_type::dealer);
  // ZMQ_HEARTBEAT stays off: in libzmq 4.3.4 it ends the process and loses data without a word.
  dealer_->set(zmq::sockopt::linger, 0);
  dealer_->set(zmq::sockopt::reconnect_ivl, -1);
  dealer_->set(zmq::sockopt::maxmsgsize, kFrameMaxBytes);
  dealer_->set(zmq::sockopt::handshake_ivl, 3000);
  dealer_->set(zmq::sockopt::tcp_keepalive, 1);
  dealer_->set(zmq::sockopt::tcp_keepalive_idle, 30);
  dealer_->set(zmq::sockopt::tcp_keepalive_intvl, 10);
  dealer_->set(zmq::sockopt::tcp_keepalive_cnt, 3);
  dealer_->set(zmq::sockopt::ipv6, endpoint_.find('[') != std::string::npos);
  // Never the address of a link before, which libzmq may still be closing.
  static std::atomic<std::uint64_t> last_number{0};
  const std::string address = "inproc://loci-link-" + std::to_string(++last_number);
  const int events = ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL |
                     ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH |
                     ZMQ_EVENT_DISCONNECTED | ZMQ_EVENT_CLOSED;
  if (zmq_socket_monitor(dealer_->handle(), address.c_str(), events) != 0) {
    throw zmq::error_t();
  }
  monitor_.emplace(Context(), zmq::socket_type::pair);
  monitor_->set(zmq::sockopt::linger, 0);
  monitor_->connect(address);
  dealer_->connect(endpoint_);
}

void ZmqLink::Close() {
  if (dealer_.has_value()) {
    zmq_socket_monitor(dealer_->handle(), nullptr, 0);
  }
  monitor_.reset();
  dealer_.reset();
  connected_ = false;
  lost_ = false;
  refused_.clear();
}

bool ZmqLink::Send(const std::string& envelope, const std::string& body) {
  if (!connected_ || lost_) {
    return false;
  }
  if (zmq_send(dealer_->handle(), envelope.data(), envelope.size(), ZMQ_SNDMORE | ZMQ_DONTWAIT) <
      0) {
    return false;  // the queue is full, or the connection is going
  }
  // The queue counts messages: what took the first frame takes the second.
  zmq_send(dealer_->handle(), body.data(), body.size(), ZMQ_DONTWAIT);
  return true;
}

LinkEvent ZmqLink::End(LinkEvent::Kind kind, std::string reason) {
  Close();
  LinkEvent event;
  event.kind = kind;
  event.reason = std::move(reason);
  return event;
}

std::optional<LinkEvent> ZmqLink::ReadMonitor() {
  zmq::message_t event;
  zmq::message_t address;
  while (monitor_->recv(event, zmq::recv_flags::dontwait).has_value()) {
    if (!monitor_->recv(address, zmq::recv_flags::dontwait).has_value()) {
      break;
    }
    std::uint16_t kind = 0;
    std::memcpy(&kind, event.data(), sizeof kind);
    switch (kind) {
      case ZMQ_EVENT_HANDSHAKE_SUCCEEDED: {
        connected_ = true;
        LinkEvent connected;
        connected.kind = LinkEvent::Kind::kConnected;
        return connected;
      }
      case ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL:
      case ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL:
      case ZMQ_EVENT_HANDSHAKE_FAILED_AUTH:
        return End(LinkEvent::Kind::kRefused, "what answers there is no Loci server");
      default:
        if (!connected_) {
          return End(LinkEvent::Kind::kRefused, "cannot connect: nothing answers there");
        }
        lost_ = true;
    }
  }
  return std::nullopt;
}

std::optional<LinkEvent> ZmqLink::ReadMessage() {
  std::array<std::string, 2> content;
  zmq::message_t frame;
  while (true) {
    std::size_t frame_count = 0;
    do {
      if (!dealer_->recv(frame, zmq::recv_flags::dontwait).has_value()) {
        return std::nullopt;
      }
      if (frame_count < content.size()) {
        content[frame_count].assign(frame.data<char>(), frame.size());
      }
      ++frame_count;
    } while (frame.more());
    if (frame_count == content.size()) {
      LinkEvent event;
      event.kind = LinkEvent::Kind::kMessage;
      event.envelope = std::move(content[0]);
      event.body = std::move(content[1]);
      return event;
    }
  }
}

LinkEvent ZmqLink::Wait(std::chrono::milliseconds timeout, bool read_messages) {
  if (!refused_.empty()) {
    return End(LinkEvent::Kind::kRefused, std::string(refused_));
  }
  const bool reading = read_messages && connected_;
  if (reading) {
    if (std::optional<LinkEvent> event = ReadMessage()) {
      return *std::move(event);
    }
    if (lost_) {
      return End(LinkEvent::Kind::kLost, "the connection was lost");
    }
  }
  std::array<zmq::pollitem_t, 3> items{{{nullptr, wake_descriptor_, ZMQ_POLLIN, 0}, {}, {}}};
  std::size_t count = 1;
  if (monitor_.has_value()) {
    items[count++] = {monitor_->handle(), 0, ZMQ_POLLIN, 0};
  }
  if (reading) {
    items[count++] = {dealer_->handle(), 0, ZMQ_POLLIN, 0};
  }
  const int ready = zmq_poll(items.data(), static_cast<int>(count), timeout.count());
  if (ready > 0 && (items[0].revents & ZMQ_POLLIN) != 0) {
    std::uint64_t wakes = 0;
    [[maybe_unused]] const ssize_t size = read(wake_descriptor_, &wakes, sizeof wakes);
    return {};
  }
  if (monitor_.has_value()) {
    if (std::optional<LinkEvent> event = ReadMonitor()) {
      return *std::move(event);
    }
  }
  if (read_messages && connected_) {
    if (std::optional<LinkEvent> event = ReadMessage()) {
      return *std::move(event);
    }
    if (lost_) {
      return End(LinkEvent::Kind::kLost, "the connection was lost");
    }
  }
  return {};
}

}  // namespace

std::unique_ptr<Link> MakeZmqLink(const std::string& endpoint) {
  return std::make_unique<ZmqLink>(endpoint);
}

}  // namespace loci::client
