// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/engine/event.h"
#include "tests/support/events.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

std::vector<Event> EventsOfEveryKind() {
  ObservationEvent bare;
  bare.session = SessionId{7};
  bare.number = 3;
  return {CreateMapEvent{.settings = {.cell_size_m = 0.1, .seed = 42}},
          ValidOpenSession(),
          ValidObservation(),
          bare,
          RefuseObservationEvent{.session = SessionId{1}, .number = 2, .reason = "late"},
          CloseSessionEvent{.session = SessionId{4}}};
}

TEST(EventCodecTest, DecodingGivesBackWhatWasEncoded) {
  for (const Event& event : EventsOfEveryKind()) {
    const std::string bytes = EncodeEvent(event);
    const StatusOr<Event> decoded = DecodeEvent(bytes);
    ASSERT_THAT(decoded, IsOk());
    EXPECT_EQ(decoded->index(), event.index());
    EXPECT_EQ(EncodeEvent(*decoded), bytes);
  }
}

TEST(EventCodecTest, FieldsOfAnObservationSurvive) {
  const ObservationEvent event = ValidObservation(5, SessionId{2});
  const StatusOr<Event> decoded = DecodeEvent(EncodeEvent(event));
  ASSERT_THAT(decoded, IsOk());
  const auto& copy = std::get<ObservationEvent>(*decoded);
  EXPECT_EQ(copy.session, event.session);
  EXPECT_EQ(copy.number, event.number);
  EXPECT_EQ(copy.stamp_ns, event.stamp_ns);
  EXPECT_EQ(copy.odometry->previous_from_robot, event.odometry->previous_from_robot);
  EXPECT_EQ(copy.odometry->covariance_upper, event.odometry->covariance_upper);
  EXPECT_EQ(copy.scan->ranges_mm, event.scan->ranges_mm);
}

// Logs outlive programs: these bytes must be read for ever.
TEST(EventCodecTest, BytesStayAsTheyWereReleased) {
  const std::string bytes =
      EncodeEvent(RefuseObservationEvent{.session = SessionId{1}, .number = 2, .reason = "ab"});
  const std::string released(
      "\x01\x03"                          // version, alternative
      "\x01\x00\x00\x00"                  // session
      "\x02\x00\x00\x00\x00\x00\x00\x00"  // number
      "\x02\x00\x00\x00\x00\x00\x00\x00"  // length of the reason
      "ab",
      24);
  EXPECT_EQ(bytes, released);
}

TEST(EventCodecTest, EveryTruncationIsDataLoss) {
  for (const Event& event : EventsOfEveryKind()) {
    const std::string bytes = EncodeEvent(event);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      EXPECT_THAT(DecodeEvent(std::string_view(bytes).substr(0, size)),
                  IsStatus(StatusCode::kDataLoss));
    }
    EXPECT_THAT(DecodeEvent(bytes + '\0'), IsStatus(StatusCode::kDataLoss, "left over"));
  }
}

TEST(EventCodecTest, UnknownVersionAndKindAreNamed) {
  std::string bytes = EncodeEvent(CloseSessionEvent{});
  bytes[1] = 9;
  EXPECT_THAT(DecodeEvent(bytes), IsStatus(StatusCode::kDataLoss, "event.kind: 9"));
  bytes[0] = 2;
  EXPECT_THAT(DecodeEvent(bytes), IsStatus(StatusCode::kDataLoss, "event.version: 2"));
}

TEST(EventCodecTest, DamagedBytesNeitherCrashNorAllocateWildly) {
  RandomSequence random(20240501);
  for (const Event& event : EventsOfEveryKind()) {
    const std::string bytes = EncodeEvent(event);
    for (int round = 0; round < 2000; ++round) {
      std::string damaged = bytes;
      for (std::uint64_t i = 0, flips = 1 + random.NextBits() % 8; i < flips; ++i) {
        damaged[random.NextBits() % damaged.size()] = static_cast<char>(random.NextBits());
      }
      const StatusOr<Event> decoded = DecodeEvent(damaged);
      if (decoded.ok()) {  // a number changed: then it encodes to the same bytes
        EXPECT_EQ(EncodeEvent(*decoded), damaged);
      }
    }
  }
}

}  // namespace
}  // namespace loci
