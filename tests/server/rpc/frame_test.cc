// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/frame.h"

#include <algorithm>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

std::string RandomBytes(RandomSequence& random, std::size_t size) {
  std::string bytes;
  for (std::size_t i = 0; i < size; ++i) {
    bytes += static_cast<char>(random.NextBits());
  }
  return bytes;
}

v1::Envelope Request() {
  v1::Envelope envelope;
  envelope.set_protocol_version(kProtocolVersion);
  envelope.set_kind(v1::FRAME_KIND_REQUEST);
  envelope.set_call_id(77);
  envelope.set_method("loci.v1.MapQuery/GetTile");
  envelope.set_timeout_us(2'000'000);
  (*envelope.mutable_metadata())["trace"] = "ab12";
  return envelope;
}

TEST(FrameTest, ReadsWhatItWrites) {
  for (const std::string& bytes : {ResponseEnvelope(5), PingEnvelope(5), PongEnvelope(5)}) {
    const std::optional<v1::Envelope> envelope = ParseEnvelope(bytes);
    ASSERT_TRUE(envelope.has_value());
    EXPECT_EQ(envelope->protocol_version(), kProtocolVersion);
    EXPECT_EQ(envelope->call_id(), 5U);
  }
}

TEST(FrameTest, AnEnvelopeOverItsLimitIsNone) {
  v1::Envelope envelope = Request();
  envelope.set_method(std::string(kEnvelopeMaxBytes - 100, 'm'));
  EXPECT_TRUE(ParseEnvelope(envelope.SerializeAsString()).has_value());
  envelope.set_method(std::string(kEnvelopeMaxBytes, 'm'));
  EXPECT_FALSE(ParseEnvelope(envelope.SerializeAsString()).has_value());
}

TEST(FrameTest, DamagedAndCutEnvelopesAreReadWholeOrNotAtAll) {
  SilenceParser();
  const std::string whole = Request().SerializeAsString();
  RandomSequence random(21);
  int refused = 0;
  for (int round = 0; round < 20'000; ++round) {
    std::string bytes = whole;
    for (std::uint64_t i = 0, changes = 1 + random.NextBits() % 4; i < changes; ++i) {
      bytes[random.NextBits() % bytes.size()] = static_cast<char>(random.NextBits());
    }
    bytes.resize(1 + random.NextBits() % bytes.size());
    const std::optional<v1::Envelope> envelope = ParseEnvelope(bytes);
    if (!envelope.has_value()) {
      ++refused;
      continue;
    }
    const std::optional<v1::Envelope> again = ParseEnvelope(envelope->SerializeAsString());
    ASSERT_TRUE(again.has_value());
    EXPECT_EQ(again->method(), envelope->method());
    EXPECT_EQ(again->call_id(), envelope->call_id());
  }
  EXPECT_GT(refused, 1000);
  EXPECT_LT(refused, 20'000);
}

TEST(FrameTest, AnyBytesOfAMessageReachTheClientAsText) {
  RandomSequence random(22);
  for (int round = 0; round < 2000; ++round) {
    const std::string message =
        RandomBytes(random, random.NextBits() % (2 * kStatusMessageMaxBytes));
    const std::optional<v1::Envelope> end = ParseEnvelope(EndEnvelope(9, InternalError(message)));
    ASSERT_TRUE(end.has_value());  // a string that is no UTF-8 would not parse
    EXPECT_EQ(end->status_code(), static_cast<std::uint32_t>(StatusCode::kInternal));
    EXPECT_LE(end->status_message().size(), kStatusMessageMaxBytes);
    EXPECT_GE(end->status_message().size(),
              std::min(message.size(), kStatusMessageMaxBytes - 3) / 4);
  }
}

}  // namespace
}  // namespace loci
