// SPDX-License-Identifier: Apache-2.0
#include "storage/record_codec.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "storage/store.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

std::string RandomBytes(std::size_t size) {
  RandomSequence random(size);
  std::string bytes(size, '\0');
  for (char& byte : bytes) {
    byte = static_cast<char>(random.NextBits());
  }
  return bytes;
}

StateRecord Record(std::string bytes) {
  return {.kind = 3, .id = 4, .bytes = std::move(bytes)};
}

TEST(RecordCodecTest, DecodingGivesBackWhatWasEncoded) {
  for (const std::string& bytes : {std::string(),
                                   std::string("x"),
                                   std::string(63, 'x'),
                                   std::string(64, 'x'),
                                   std::string(1 << 20, 'x'),
                                   RandomBytes(64),
                                   RandomBytes(100'000)}) {
    const StatusOr<StateRecord> record = DecodeRecord(EncodeRecord(Record(bytes), {5}));
    ASSERT_THAT(record, IsOk());
    EXPECT_EQ(record->kind, 3U);
    EXPECT_EQ(record->id, 4U);
    EXPECT_EQ(record->bytes, bytes);
  }
}

TEST(RecordCodecTest, WhatDoesNotGetSmallerIsStoredAsItIs) {
  EXPECT_EQ(EncodeRecord(Record(RandomBytes(5000)), {5}).bytes, RandomBytes(5000));
  EXPECT_LT(EncodeRecord(Record(std::string(5000, 'x')), {5}).bytes.size(), 100U);
}

TEST(RecordCodecTest, EveryChangedFieldIsDataLoss) {
  const StoredRecord right = EncodeRecord(Record("some bytes"), {5});
  std::vector<StoredRecord> wrong(6, right);
  wrong[0].kind += 1;
  wrong[1].id += 1;
  wrong[2].valid_from.value += 1;
  wrong[3].size_bytes += 1;
  wrong[4].checksum += 1;
  wrong[5].bytes[3] = static_cast<char>(wrong[5].bytes[3] ^ 1);
  for (const StoredRecord& stored : wrong) {
    EXPECT_THAT(DecodeRecord(stored), IsStatus(StatusCode::kDataLoss, "checksum"));
  }
}

TEST(RecordCodecTest, ALogEntryCannotPassForAnother) {
  const std::uint32_t right = LogEntryChecksum({7}, 100, "bytes");
  EXPECT_NE(LogEntryChecksum({8}, 100, "bytes"), right);
  EXPECT_NE(LogEntryChecksum({7}, 101, "bytes"), right);
  EXPECT_NE(LogEntryChecksum({7}, 100, "bytfs"), right);
  EXPECT_NE(LogEntryChecksum({7}, 100, "byte"), right);
}

}  // namespace
}  // namespace loci
