// SPDX-License-Identifier: Apache-2.0
// Records that do not fit together are kDataLoss, and nothing in them ends the process.
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/engine/engine.h"
#include "tests/support/loop_world.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

// A map with two sessions, the second one still open, and something of every kind of record.
const std::vector<StateRecord>& Records() {
  static const std::vector<StateRecord> kRecords = [] {
    const SimulatedMap loop = DriveAroundTheBlock(1);
    Engine engine = EngineOf(loop.events);
    engine.Apply(OpenSessionEvent{"second", "robot", loop.map_from_robot[0]});
    for (std::size_t i = 2; i < 60; ++i) {
      ObservationEvent event = std::get<ObservationEvent>(loop.events[i]);
      event.session = SessionId{1};
      engine.Apply(event);
    }
    engine.Apply(OpenSessionEvent{"third", "robot", loop.map_from_robot[0]});
    return engine.ChangesSince(EventNumber{0}).written;
  }();
  return kRecords;
}

std::string NameOf(const StateRecord& record) {
  return "record " + std::to_string(record.kind) + "/" + std::to_string(record.id);
}

TEST(DamagedRecordsTest, TheRecordsAreReadInAnyOrder) {
  ASSERT_THAT(Engine::FromRecords(Records()), IsOk());
  std::vector<StateRecord> reversed(Records().rbegin(), Records().rend());
  const StatusOr<Engine> engine = Engine::FromRecords(reversed);
  ASSERT_THAT(engine, IsOk());
  EXPECT_EQ(engine->StateDigest(), Engine::FromRecords(Records())->StateDigest());
}

TEST(DamagedRecordsTest, EveryMissingRecordIsMissed) {
  for (std::size_t i = 0; i < Records().size(); ++i) {
    std::vector<StateRecord> records = Records();
    records.erase(records.begin() + static_cast<std::ptrdiff_t>(i));
    EXPECT_THAT(Engine::FromRecords(records), IsStatus(StatusCode::kDataLoss))
        << NameOf(Records()[i]);
  }
}

TEST(DamagedRecordsTest, EveryTruncatedRecordIsDataLoss) {
  for (std::size_t i = 0; i < Records().size(); ++i) {
    const std::size_t size = Records()[i].bytes.size();
    for (const std::size_t kept : {std::size_t{0}, size / 3, size - 1}) {
      std::vector<StateRecord> records = Records();
      records[i].bytes.resize(kept);
      EXPECT_THAT(Engine::FromRecords(records), IsStatus(StatusCode::kDataLoss))
          << NameOf(Records()[i]) << " " << kept;
    }
  }
}

TEST(DamagedRecordsTest, FlippedBitsAreDataLossOrReadAndNeverACrash) {
  RandomSequence random(1);
  std::size_t refused = 0;
  for (int round = 0; round < 150; ++round) {
    std::vector<StateRecord> records = Records();
    StateRecord& record = records[random.NextBits() % records.size()];
    // Lengths and numbers stand at the beginning more often than elsewhere.
    const std::size_t reach =
        round % 2 == 0 ? std::min<std::size_t>(record.bytes.size(), 64) : record.bytes.size();
    const std::size_t at = random.NextBits() % reach;
    record.bytes[at] ^= static_cast<char>(1U << (random.NextBits() % 8U));
    const StatusOr<Engine> engine = Engine::FromRecords(records);
    refused += engine.ok() ? 0U : 1U;
    if (!engine.ok()) {
      EXPECT_EQ(engine.status().code(), StatusCode::kDataLoss)
          << NameOf(record) << " " << engine.status().ToString();
    }
  }
  EXPECT_GT(refused, 20U);
}

TEST(DamagedRecordsTest, NoRecordsAreTheEmptyMap) {
  const StatusOr<Engine> engine = Engine::FromRecords({});
  ASSERT_THAT(engine, IsOk());
  EXPECT_EQ(engine->StateDigest(), Engine().StateDigest());
}

}  // namespace
}  // namespace loci
