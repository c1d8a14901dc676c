// SPDX-License-Identifier: Apache-2.0
// Peers that mean harm, on both ports: they get an answer or the door, and the server goes on.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/support/frame_peer.h"
#include "tests/support/programs.h"

namespace loci {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class HostilePeerTest : public ProgramsTest {
 protected:
  HostilePeerTest() {
    StartServer();
    Stream(WriteOfficeLog(Path("log"), 60), "hall");
    digest_ = OutcomeOf("hall").digest;
  }
  // The map is as it was, both ports answer, and the server ends in order.
  void ExpectServing() {
    EXPECT_EQ(LociJson({"status"})["ready"], true);
    EXPECT_EQ(LociJson({"map", "info", "hall"})["state_digest"], digest_);
    EXPECT_EQ(HttpGet(server().http_port(), "/maps/hall/tiles/occupancy/8/0/0.png").status, 200);
    EXPECT_EQ(server().End(SIGTERM), 0);
  }
  static std::string RandomBytes(RandomSequence& random, std::size_t count) {
    std::string bytes(count, '\0');
    for (char& byte : bytes) {
      byte = static_cast<char>(random.NextBits() & 0xFFU);
    }
    return bytes;
  }

 private:
  std::string digest_;
};

TEST_F(HostilePeerTest, PathsThatLeadOutOfTheMapsAndAbsurdTilesAreRefused) {
  for (const char* target :
       {"/../../../../etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "/maps/..%2f..%2fetc%2fpasswd",
        "/maps/..%5c..%5cwindows",
        "/maps/hall.loci",
        "/maps/hall/../hall.loci",
        "/maps/hall%00.loci",
        "//etc/passwd",
        "/maps/hall/tiles/../8/0/0.png",
        "/maps/hall/tiles/occupancy/25/0/0.png",
        "/maps/hall/tiles/occupancy/-1/0/0.png",
        "/maps/hall/tiles/occupancy/8/16777216/0.png",
        "/maps/hall/tiles/occupancy/8/0/-16777216.png",
        "/maps/hall/tiles/occupancy/8/99999999999999999999/0.png",
        "/maps/hall/tiles/occupancy/8/1e3/0x10.png",
        "/maps/hall/tiles/occupancy/8/0/0.png?revision=-1",
        "/maps/hall/tiles/occupancy/8/0/0.png?revision=99999999999",
        "/maps/hall/tiles/occupancy/8/0/0.png?revision=18446744073709551616"}) {
    const HttpReply reply = HttpGet(server().http_port(), target);
    EXPECT_GE(reply.status, 400) << target;
    EXPECT_LT(reply.status, 500) << target;
    EXPECT_EQ(reply.body.find("root:"), std::string::npos) << target;
  }
  // The largest that are allowed are no error.
  for (const char* target : {"/maps/hall/tiles/occupancy/24/16777215/-16777215.png",
                             "/maps/hall/tiles/occupancy/0/-16777215/16777215.png"}) {
    EXPECT_EQ(HttpGet(server().http_port(), target).status, 200) << target;
  }
  ExpectServing();
}

TEST_F(HostilePeerTest, AViewerThatDripsItsRequestIsCutByTheDeadlineAndHoldsUpNobody) {
  RawClient drip(server().http_port());
  const auto begin = std::chrono::steady_clock::now();
  bool cut = false;
  for (const char byte :
       std::string_view("GET /maps/hall/tiles/occupancy/8/0/0.png?revision=1 HTTP/1.1"
                        "\r\nHost: a-name-that-never-ends-because-it-never-ends")) {
    if (!drip.Send({&byte, 1}) || drip.IsClosedWithin(milliseconds(100))) {
      cut = true;
      break;
    }
    EXPECT_EQ(HttpGet(server().http_port(), "/healthz").status, 200);
  }
  EXPECT_TRUE(cut);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, seconds(8));
  ExpectServing();
}

TEST_F(HostilePeerTest, RandomBytesOnEitherPortEndInAClosedConnection) {
  RandomSequence random(11);
  for (int round = 0; round < 20; ++round) {
    const std::string bytes = RandomBytes(random, std::size_t{1} << (random.NextBits() % 17));
    RawClient http(server().http_port());
    http.Send(bytes);
    http.Send("\r\n\r\n");
    EXPECT_TRUE(http.IsClosedWithin(seconds(8))) << "round " << round;
    RawClient robot(server().rpc_port());
    robot.Send(bytes);
  }
  ExpectServing();
}

TEST_F(HostilePeerTest, HttpAndHalfOpenHandshakesOnTheRobotsPortAreClosed) {
  RawClient browser(server().rpc_port());
  browser.Send("GET / HTTP/1.1\r\nHost: loci\r\n\r\n");
  std::vector<std::unique_ptr<RawClient>> half_open;
  std::string greeting("\xff\0\0\0\0\0\0\0\1\x7f\3\0NULL", 16);  // ZMTP 3.0, its NULL mechanism
  greeting.resize(64, '\0');
  for (const std::size_t count : {0U, 1U, 10U, 12U, 63U, 64U}) {
    half_open.push_back(std::make_unique<RawClient>(server().rpc_port()));
    half_open.back()->Send(greeting.substr(0, count));
  }
  EXPECT_TRUE(browser.IsClosedWithin(seconds(8)));
  for (const auto& client : half_open) {
    EXPECT_TRUE(client->IsClosedWithin(seconds(8)));
  }
  ExpectServing();
}

TEST_F(HostilePeerTest, RandomFramesOfAGreetedPeerNeverEndTheServer) {
  RandomSequence random(12);
  std::string greeting("\xff\0\0\0\0\0\0\0\1\x7f\3\0NULL", 16);
  greeting.resize(64, '\0');
  // READY with the socket type DEALER.
  const std::string ready(
      "\x04\x1c\x05READY\x0bSocket-Type\0\0\0\x06"
      "DEALER",
      30);
  for (int round = 0; round < 20; ++round) {
    RawClient peer(server().rpc_port());
    peer.Send(greeting + ready);
    for (int frame = 0; frame < 20; ++frame) {
      const std::size_t size = 1 + random.NextBits() % 200;
      // The bits of the flags: more, long, command.
      std::string header(1, static_cast<char>(random.NextBits() % 2));
      header += static_cast<char>(size);
      if (!peer.Send(header + RandomBytes(random, size))) {
        break;
      }
    }
  }
  ExpectServing();
}

class HostilePeerLogTest : public ProgramsTest {};

TEST_F(HostilePeerLogTest, WhatAPeerSendsDoesNotFillTheLog) {
  testing::internal::CaptureStderr();
  StartServer();
  FramePeer peer(server().endpoint());
  v1::Envelope envelope;
  envelope.set_protocol_version(1);
  envelope.set_kind(v1::FRAME_KIND_PING);
  envelope.set_call_id(1);
  const std::string ping = envelope.SerializeAsString();
  envelope.set_method("m");
  std::string no_text = envelope.SerializeAsString();
  no_text.back() = '\xff';
  for (int i = 0; i < 100; ++i) {
    peer.Send({no_text, ""});
  }
  peer.Send({ping, ""});
  EXPECT_EQ(peer.Receive().kind(), v1::FRAME_KIND_PONG);  // all before it was read
  EXPECT_EQ(server().End(SIGTERM), 0);
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_THAT(log, testing::HasSubstr("event=stopped"));
  EXPECT_LT(std::count(log.begin(), log.end(), '\n'), 50) << log;
}

}  // namespace
}  // namespace loci
