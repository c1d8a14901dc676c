// SPDX-License-Identifier: Apache-2.0
// Messages that are too large, cut off, of another version, or none: over the wire, to a whole
// server.
#include <cstdint>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loci/v1/envelope.pb.h"
#include "tests/support/bad_input.h"
#include "tests/support/frame_peer.h"
#include "tests/support/raw_client.h"

namespace loci {
namespace {

// A batch of at least so many bytes.
v1::AppendBatchRequest LargeBatch(std::size_t size_bytes) {
  v1::AppendBatchRequest request = BatchOf("hall", "s", RoomDrive(11), 10, 11);
  v1::Observation large = request.observations(0);
  large.mutable_scan()->mutable_ranges_mm()->Resize(4096, 60000);
  while (request.ByteSizeLong() < size_bytes) {
    *request.add_observations() = large;
  }
  return request;
}

TEST_F(BadInputTest, ARequestOverTheSizeLimitIsRefused) {
  const std::string digest = Digest();
  EXPECT_THAT(server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch",
                                                    LargeBatch((std::size_t{4} << 20U) + 1000)),
              IsStatus(StatusCode::kResourceExhausted, "at most 4194304 are allowed"));
  EXPECT_EQ(Digest(), digest);
  ExpectServes();
}

TEST_F(BadInputTest, ARequestOverTheFrameLimitLosesItsConnectionAndNothingElse) {
  const std::string digest = Digest();
  EXPECT_THAT(server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch",
                                                    LargeBatch(std::size_t{6} << 20U)),
              IsStatus(StatusCode::kUnavailable));
  EXPECT_EQ(Digest(), digest);
  ExpectServes();
}

// What would be a good batch otherwise.
v1::Envelope BatchEnvelope(std::uint32_t version, std::uint64_t call_id) {
  v1::Envelope envelope;
  envelope.set_protocol_version(version);
  envelope.set_kind(v1::FRAME_KIND_REQUEST);
  envelope.set_call_id(call_id);
  envelope.set_method("loci.v1.Mapping/AppendBatch");
  return envelope;
}

TEST_F(BadInputTest, AnUnknownProtocolVersionIsRefusedWithTheOneSpoken) {
  const std::string digest = Digest();
  const std::string body = BatchOf("hall", "s", RoomDrive(20), 10, 20).SerializeAsString();
  FramePeer peer(server_.server().rpc_endpoint());
  for (const std::uint32_t version : {2U, 7U, 0xFFFFFFFFU}) {
    peer.Send({BatchEnvelope(version, version).SerializeAsString(), body});
    const v1::Envelope end = peer.Receive();
    EXPECT_EQ(end.kind(), v1::FRAME_KIND_END);
    EXPECT_EQ(end.call_id(), version);
    EXPECT_THAT(
        Status(static_cast<StatusCode>(end.status_code()), end.status_message()),
        IsStatus(StatusCode::kFailedPrecondition,
                 "protocol_version " + std::to_string(version) + ": this server speaks version 1"));
    EXPECT_EQ(Digest(), digest);
  }
  ExpectServes();
}

TEST_F(BadInputTest, TruncatedFramesChangeNothing) {
  const std::string digest = Digest();
  const std::string body = BatchOf("hall", "s", RoomDrive(20), 10, 20).SerializeAsString();
  FramePeer peer(server_.server().rpc_endpoint());
  // Envelopes that are cut off, and a message without its second frame, are no calls: ignored.
  const std::string envelope = BatchEnvelope(1, 1).SerializeAsString();
  for (std::size_t size = 0; size < envelope.size(); size += 3) {
    peer.Send({envelope.substr(0, size), body});
  }
  peer.Send({envelope});
  // A body that is cut off within an observation is an answered error.
  std::uint64_t call_id = 1;
  for (const std::size_t size : {body.size() - 1, body.size() / 2, body.size() / 3}) {
    peer.Send({BatchEnvelope(1, ++call_id).SerializeAsString(), body.substr(0, size)});
    v1::Envelope end = peer.Receive();
    // Of the envelopes above, one may have kept all that a call needs but its method.
    while (end.call_id() != call_id) {
      end = peer.Receive();
    }
    EXPECT_THAT(Status(static_cast<StatusCode>(end.status_code()), end.status_message()),
                IsStatus(StatusCode::kInvalidArgument, "AppendBatch"))
        << size;
    EXPECT_EQ(Digest(), digest);
  }
  {
    // A frame that says it has 1000 bytes, and a connection that ends after 10 of them.
    const std::string& endpoint = server_.server().rpc_endpoint();
    RawClient cut(static_cast<std::uint16_t>(std::stoul(endpoint.substr(endpoint.rfind(':') + 1))));
    std::string greeting("\xFF\0\0\0\0\0\0\0\x01\x7F\x03\0NULL", 16);
    greeting.resize(64, '\0');
    greeting += std::string("\x04\x1C\x05READY\x0BSocket-Type\0\0\0\x06", 24) + "DEALER";
    EXPECT_TRUE(
        cut.Send(greeting + std::string("\x03\0\0\0\0\0\0\x03\xE8", 9) + envelope.substr(0, 10)));
  }
  EXPECT_EQ(Digest(), digest);
  ExpectServes();
}

TEST_F(BadInputTest, WhatIsRefusedIsCountedByMethodAndCode) {
  v1::AppendBatchRequest request = BatchOf("hall", "s", RoomDrive(11), 10, 11);
  request.mutable_observations(0)->mutable_scan()->set_angle_min_rad(kNan);
  EXPECT_FALSE(server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch", request).ok());
  const std::string& endpoint = server_.server().http_endpoint();
  RawClient http(static_cast<std::uint16_t>(std::stoul(endpoint.substr(endpoint.rfind(':') + 1))));
  http.Send("GET /metrics HTTP/1.1\r\nHost: loci\r\nConnection: close\r\n\r\n");
  const std::string metrics = http.ReadToEnd();
  EXPECT_THAT(metrics,
              testing::ContainsRegex("loci_rpc_calls_total[{][^}]*INVALID_ARGUMENT[^}]*[}] 1\n"));
}

TEST_F(BadInputTest, BytesThatAreNoMessageAreRefused) {
  const std::string digest = Digest();
  for (const std::string& bytes : {std::string("\xFF\xFF\xFF\xFF"),
                                   std::string("\x0A\x7F"
                                               "abc"),
                                   std::string(1000, '\0')}) {
    EXPECT_THAT(server_.channel().CallRaw("loci.v1.Mapping/AppendBatch", bytes),
                IsStatus(StatusCode::kInvalidArgument));
    EXPECT_EQ(Digest(), digest);
  }
  EXPECT_THAT(server_.channel().CallRaw("loci.v1.Mapping/Fly", ""),
              IsStatus(StatusCode::kUnimplemented));
  EXPECT_THAT(server_.channel().CallRaw("", ""), IsStatus(StatusCode::kUnimplemented));
  EXPECT_EQ(Digest(), digest);
}

}  // namespace
}  // namespace loci
