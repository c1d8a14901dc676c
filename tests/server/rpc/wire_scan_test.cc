// SPDX-License-Identifier: Apache-2.0
// Bodies that would grow when they are parsed do not get that far.
#include "server/rpc/wire_scan.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "loci/v1/mapping.pb.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

const google::protobuf::Descriptor& BatchType() {
  return *v1::AppendBatchRequest::descriptor();
}

v1::AppendBatchRequest Batch(int observation_count) {
  v1::AppendBatchRequest request;
  request.set_map("m");
  for (int i = 0; i < observation_count; ++i) {
    v1::Observation& observation = *request.add_observations();
    observation.set_stamp_ns(i);
    observation.mutable_odometry()->mutable_previous_from_robot()->set_x(1.0);
    for (int j = 0; j < 361; ++j) {
      observation.mutable_scan()->add_ranges_mm(static_cast<std::uint32_t>(100 * j));
    }
  }
  return request;
}

TEST(WireScanTest, PassesWhatClientsSend) {
  for (const int count : {0, 1, 1000}) {
    EXPECT_THAT(CheckWire(Batch(count).SerializeAsString(), BatchType(), {}), IsOk());
  }
}

TEST(WireScanTest, RefusesEmptyMessagesWithoutEnd) {
  std::string bomb;
  for (int i = 0; i < 1'000'000; ++i) {
    bomb += std::string("\x22\0", 2);  // observations, of no bytes
  }
  EXPECT_THAT(CheckWire(bomb, BatchType(), {}),
              IsStatus(StatusCode::kInvalidArgument, "more than 65536"));
}

TEST(WireScanTest, RefusesUnknownFieldsWithoutEnd) {
  std::string bomb;
  for (int i = 0; i < 1'000'000; ++i) {
    bomb += std::string("\x78\0", 2);  // field 15, a varint
  }
  EXPECT_THAT(CheckWire(bomb, BatchType(), {}), IsStatus(StatusCode::kInvalidArgument));
}

TEST(WireScanTest, RefusesWhatNestsTooDeep) {
  WireLimits limits;
  limits.depth_max = 3;  // batch, observation, odometry; not its pose
  v1::AppendBatchRequest request = Batch(1);
  EXPECT_THAT(CheckWire(request.SerializeAsString(), BatchType(), limits),
              IsStatus(StatusCode::kInvalidArgument, "deeper than 3"));
  request.mutable_observations(0)->clear_odometry();
  EXPECT_THAT(CheckWire(request.SerializeAsString(), BatchType(), limits), IsOk());
}

TEST(WireScanTest, RefusesGroups) {
  EXPECT_THAT(CheckWire("\x7B\x7C", BatchType(), {}),
              IsStatus(StatusCode::kInvalidArgument, "group"));
}

TEST(WireScanTest, ATruncatedMessagePassesOnlyIfItParses) {
  const std::string whole = Batch(3).SerializeAsString();
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    v1::AppendBatchRequest parsed;
    const bool parses = parsed.ParseFromString(whole.substr(0, size));
    EXPECT_EQ(CheckWire(whole.substr(0, size), BatchType(), {}).ok(), parses) << size;
  }
}

TEST(WireScanTest, SurvivesAnyBytes) {
  const std::string whole = Batch(3).SerializeAsString();
  RandomSequence random(11);
  for (int i = 0; i < 20'000; ++i) {
    std::string bytes = whole;
    for (int j = 0; j < 4; ++j) {
      bytes[random.NextBits() % bytes.size()] = static_cast<char>(random.NextBits());
    }
    IgnoreError(CheckWire(bytes, BatchType(), {}),
                "either answer is right; it must not read beyond");
  }
}

}  // namespace
}  // namespace loci
