// SPDX-License-Identifier: Apache-2.0
// What the socket survives: peers that do not speak the protocol, and peers that abuse it.
#include "server/transport/zmq_transport.h"

#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <zmq.hpp>

#include "core/base/random.h"
#include "loci/v1/envelope.pb.h"
#include "tests/support/frame_peer.h"
#include "tests/support/matchers.h"
#include "tests/support/rpc_server.h"

namespace loci {
namespace {

using Request = v1::HealthCheckRequest;
using Response = v1::HealthCheckResponse;
using std::chrono::milliseconds;

// A plain TCP connection.
class RawPeer {
 public:
  explicit RawPeer(const std::string& endpoint) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port =
        htons(static_cast<std::uint16_t>(std::stoi(endpoint.substr(endpoint.rfind(':') + 1))));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval receive_limit{20, 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &receive_limit, sizeof receive_limit);
    // A server that has dropped us may leave us with a window of zero instead of a reset.
    const timeval send_limit{2, 0};
    setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &send_limit, sizeof send_limit);
    connected_ = connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  }
  RawPeer(const RawPeer&) = delete;
  RawPeer& operator=(const RawPeer&) = delete;
  ~RawPeer() { close(socket_); }

  bool connected() const { return connected_; }
  // False when the server has closed the connection, or takes nothing.
  bool Send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t sent = send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent <= 0) {
        return false;
      }
      bytes.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }
  // True when the server closes within the socket's time limit.
  bool IsClosed() {
    std::array<char, 4096> buffer{};
    ssize_t size = 0;
    do {
      size = recv(socket_, buffer.data(), buffer.size(), 0);
    } while (size > 0);
    return size == 0 || errno == ECONNRESET;
  }
  // The greeting of ZMTP 3.0 with the NULL mechanism, a DEALER's READY, and the server's.
  bool Handshake() {
    std::string bytes("\xFF\0\0\0\0\0\0\0\x01\x7F\x03\0NULL", 16);
    bytes.resize(64, '\0');
    bytes += std::string(
        "\x04\x1C\x05READY\x0BSocket-Type\0\0\0\x06"
        "DEALER",
        30);
    if (!Send(bytes)) {
      return false;
    }
    std::string received;
    std::array<char, 4096> buffer{};
    while (received.find("READY") == std::string::npos) {
      const ssize_t size = recv(socket_, buffer.data(), buffer.size(), 0);
      if (size <= 0) {
        return false;
      }
      received.append(buffer.data(), static_cast<std::size_t>(size));
    }
    return true;
  }

 private:
  const int socket_;
  bool connected_ = false;
};

std::string RequestEnvelope(std::uint32_t version, std::uint64_t call_id) {
  v1::Envelope envelope;
  envelope.set_protocol_version(version);
  envelope.set_kind(v1::FRAME_KIND_REQUEST);
  envelope.set_call_id(call_id);
  envelope.set_method(kCheck);
  return envelope.SerializeAsString();
}

std::size_t ResidentBytes() {
  std::FILE* file = std::fopen("/proc/self/statm", "r");
  unsigned long pages = 0;
  unsigned long resident = 0;
  EXPECT_EQ(std::fscanf(file, "%lu %lu", &pages, &resident), 2);
  std::fclose(file);
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

class ZmqTransportTest : public testing::Test {
 protected:
  explicit ZmqTransportTest(RpcServerOptions options = {})
      : server_(Wire::kZmq, RpcServer::Serve, nullptr, std::move(options)) {}
  std::string endpoint() { return server_.transport().endpoint(); }
  const TransportCounters& counters() { return server_.transport().counters(); }
  // Perhaps not the first time: a client that this machine is too busy for greets too slowly, and
  // is cut as it should be.
  void ExpectServes() {
    EXPECT_TRUE(
        Eventually([&] { return server_.Connect()->Call<Response>(kCheck, Request()).ok(); }));
  }
  RpcServer server_;
};

class ImpatientTransportTest : public ZmqTransportTest {
 protected:
  static RpcServerOptions Impatient() {
    RpcServerOptions options;
    options.zmq.handshake_max = milliseconds(100);
    options.zmq.connection_backlog_max_bytes = std::size_t{16} << 20U;
    options.zmq.backlog_growth_max_bytes = std::size_t{32} << 20U;
    return options;
  }
  ImpatientTransportTest() : ZmqTransportTest(Impatient()) {}
};

TEST_F(ZmqTransportTest, TellsThePortThatItTook) {
  EXPECT_THAT(endpoint(), testing::StartsWith("tcp://127.0.0.1:"));
  EXPECT_NE(endpoint(), "tcp://127.0.0.1:0");
}

TEST_F(ZmqTransportTest, SaysThatAnAddressIsTaken) {
  ZmqTransportOptions options;
  options.endpoint = endpoint();
  EXPECT_THAT(ZmqTransport::Listen(options).status(),
              IsStatus(StatusCode::kUnavailable, endpoint()));
  options.endpoint = "tcp://203.0.113.1:1";
  EXPECT_THAT(ZmqTransport::Listen(options).status(),
              IsStatus(StatusCode::kInvalidArgument, options.endpoint));
}

TEST(ListenEndpointTest, IsLoopbackUnlessTheUserInsists) {
  for (const char* endpoint :
       {"tcp://127.0.0.1:5600", "tcp://127.8.9.1:0", "tcp://localhost:1", "tcp://[::1]:5600"}) {
    EXPECT_THAT(CheckListenEndpoint(endpoint, false), IsOk()) << endpoint;
  }
  for (const char* endpoint :
       {"tcp://0.0.0.0:5600", "tcp://*:5600", "tcp://192.168.1.4:5600", "tcp://127.0.0.1.evil:1"}) {
    EXPECT_THAT(CheckListenEndpoint(endpoint, false),
                IsStatus(StatusCode::kInvalidArgument, "--insecure"))
        << endpoint;
    EXPECT_THAT(CheckListenEndpoint(endpoint, true), IsOk()) << endpoint;
  }
  for (const char* endpoint : {"127.0.0.1:5600",
                               "ipc://x",
                               "tcp://127.0.0.1",
                               "tcp://:1",
                               "tcp://127.0.0.1:70000",
                               "tcp://127.0.0.1:1x"}) {
    EXPECT_THAT(CheckListenEndpoint(endpoint, true),
                IsStatus(StatusCode::kInvalidArgument, "tcp://HOST:PORT"))
        << endpoint;
  }
}

TEST_F(ImpatientTransportTest, ClosesPeersThatSendRandomBytes) {
  RandomSequence random(7);
  for (int i = 0; i < 8; ++i) {
    std::string bytes(4096, '\0');
    for (char& byte : bytes) {
      byte = static_cast<char>(random.NextBits());
    }
    RawPeer peer(endpoint());
    peer.Send(bytes);
    EXPECT_TRUE(peer.IsClosed());
  }
  ExpectServes();
}

TEST_F(ImpatientTransportTest, ClosesPeersThatSpeakHttp) {
  RawPeer peer(endpoint());
  peer.Send("GET / HTTP/1.1\r\nHost: localhost\r\nUser-Agent: somebody\r\nAccept: */*\r\n\r\n");
  EXPECT_TRUE(peer.IsClosed());
  ExpectServes();
}

TEST_F(ImpatientTransportTest, ClosesHalfOpenHandshakes) {
  std::vector<std::unique_ptr<RawPeer>> peers;
  for (int i = 0; i < 50; ++i) {
    peers.push_back(std::make_unique<RawPeer>(endpoint()));
    ASSERT_TRUE(peers.back()->connected());
    if (i % 2 == 0) {
      peers.back()->Send(std::string("\xFF\0\0\0\0\0\0\0\x01\x7F\x03", 11));
    }
  }
  ExpectServes();
  for (const auto& peer : peers) {
    EXPECT_TRUE(peer->IsClosed());
  }
  EXPECT_TRUE(Eventually([&] { return counters().connections.load() == 0; }));
}

TEST_F(ZmqTransportTest, IgnoresMessagesThatHaveNotTwoFrames) {
  FramePeer peer(endpoint());
  peer.Send({RequestEnvelope(1, 1)});
  peer.Send({RequestEnvelope(1, 2), "", ""});
  peer.Send(std::vector<std::string>(1000, "x"));
  peer.Send({RequestEnvelope(1, 3), ""});
  EXPECT_EQ(peer.Receive().call_id(), 3U);
  EXPECT_EQ(counters().messages_ignored.load(), 3U);
}

TEST_F(ZmqTransportTest, IgnoresEnvelopesThatDoNotParse) {
  FramePeer peer(endpoint());
  const std::string whole = RequestEnvelope(1, 1);
  peer.Send({whole.substr(0, whole.size() - 3), ""});
  peer.Send({std::string(100'000, 'x'), ""});
  peer.Send({"", ""});
  peer.Send({RequestEnvelope(1, 2), ""});
  EXPECT_EQ(peer.Receive().call_id(), 2U);
  EXPECT_EQ(server_.dispatcher().counters().envelopes_refused.load(), 3U);
}

TEST_F(ZmqTransportTest, RefusesOtherProtocolVersionsWithAText) {
  FramePeer peer(endpoint());
  peer.Send({RequestEnvelope(7, 5), ""});
  const v1::Envelope end = peer.Receive();
  EXPECT_EQ(end.kind(), v1::FRAME_KIND_END);
  EXPECT_EQ(end.call_id(), 5U);
  EXPECT_EQ(end.status_code(), static_cast<std::uint32_t>(StatusCode::kFailedPrecondition));
  EXPECT_THAT(end.status_message(), testing::HasSubstr("protocol_version 7"));
  ExpectServes();
}

TEST_F(ZmqTransportTest, ServesARepeatedRequestOnce) {
  FramePeer peer(endpoint());
  peer.Send({RequestEnvelope(1, 9), ""});
  peer.Send({RequestEnvelope(1, 9), ""});
  peer.Send({RequestEnvelope(1, 8), ""});
  EXPECT_TRUE(
      Eventually([&] { return server_.dispatcher().counters().requests_repeated.load() == 2; }));
  EXPECT_EQ(peer.Receive().kind(), v1::FRAME_KIND_RESPONSE);
  EXPECT_EQ(peer.Receive().kind(), v1::FRAME_KIND_END);
  EXPECT_TRUE(
      Eventually([&] { return server_.counters(kCheck).calls_with(StatusCode::kOk) == 1; }));
}

TEST_F(ZmqTransportTest, AnswersPings) {
  FramePeer peer(endpoint());
  v1::Envelope ping;
  ping.set_protocol_version(1);
  ping.set_kind(v1::FRAME_KIND_PING);
  ping.set_call_id(77);
  peer.Send({ping.SerializeAsString(), ""});
  const v1::Envelope pong = peer.Receive();
  EXPECT_EQ(pong.kind(), v1::FRAME_KIND_PONG);
  EXPECT_EQ(pong.call_id(), 77U);
}

TEST_F(ZmqTransportTest, ClosesPeersThatSendAFrameOverTheLimit) {
  RawPeer peer(endpoint());
  ASSERT_TRUE(peer.Handshake());
  // A long frame of 1 GiB, of which nothing needs to follow.
  peer.Send(std::string("\x02\0\0\0\0\x40\0\0\0", 9));
  EXPECT_TRUE(peer.IsClosed());
  ExpectServes();
}

// Endless messages: libzmq keeps every frame until the last, which never comes.
TEST_F(ImpatientTransportTest, BoundsTheMemoryOfEndlessMessagesOfLargeFrames) {
  RawPeer peer(endpoint());
  ASSERT_TRUE(peer.Handshake());
  const std::size_t before = ResidentBytes();
  const std::string frame = std::string("\x03\0\0\0\0\0\x01\0\0", 9) + std::string(65'536, 'x');
  std::size_t sent = 0;
  std::size_t largest = before;
  constexpr std::size_t kMuch = std::size_t{2} << 30U;
  while (counters().connections_cut == 0 && sent < kMuch && peer.Send(frame)) {
    sent += frame.size();
    largest = std::max(largest, ResidentBytes());
  }
  EXPECT_LT(sent, kMuch);
  EXPECT_LT(largest - before, std::size_t{400} << 20U);
  EXPECT_TRUE(Eventually([&] { return counters().connections_cut.load() == 1; }));
  ExpectServes();
}

TEST_F(ImpatientTransportTest, BoundsTheMemoryOfEndlessMessagesOfEmptyFrames) {
  RawPeer peer(endpoint());
  ASSERT_TRUE(peer.Handshake());
  const std::size_t before = ResidentBytes();
  std::string frames;
  for (int i = 0; i < 32'768; ++i) {
    frames += std::string("\x01\0", 2);
  }
  std::size_t sent = 0;
  std::size_t largest = before;
  constexpr std::size_t kMuch = std::size_t{512} << 20U;
  while (counters().connections_cut == 0 && sent < kMuch && peer.Send(frames)) {
    sent += frames.size();
    largest = std::max(largest, ResidentBytes());
  }
  EXPECT_LT(sent, kMuch);
  EXPECT_LT(largest - before, std::size_t{600} << 20U);
  EXPECT_TRUE(Eventually([&] { return counters().connections_cut.load() == 1; }));
  ExpectServes();
}

TEST_F(ImpatientTransportTest, DoesNotCutHonestPeersThatSendMuch) {
  const auto channel = server_.Connect();
  Request request;
  request.set_service(std::string(std::size_t{2} << 20U, 'x'));
  for (int i = 0; i < 40; ++i) {
    EXPECT_THAT(channel->Call<Response>(kCheck, request), IsOk());
  }
  EXPECT_EQ(counters().connections_cut.load(), 0U);
}

TEST_F(ZmqTransportTest, StopsAtOnceWithDeadAndSilentPeers) {
  RawPeer silent(endpoint());
  RawPeer ready(endpoint());
  ASSERT_TRUE(ready.Handshake());
  const auto channel = server_.Connect();
  EXPECT_THAT(channel->Call<Response>(kCheck, Request()), IsOk());
  const auto begin = std::chrono::steady_clock::now();
  server_.dispatcher().Stop();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(3));
}

}  // namespace
}  // namespace loci
