// SPDX-License-Identifier: Apache-2.0
#include "clients/log/stamp_sorter.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

LogScan At(std::int64_t stamp_ms, std::size_t line = 0) {
  LogScan scan;
  scan.stamp_ns = stamp_ms * 1'000'000;
  scan.line = line;
  return scan;
}

std::vector<std::int64_t> Sorted(StampSorter& sorter, const std::vector<std::int64_t>& stamps_ms) {
  std::vector<std::int64_t> sorted;
  const auto drain = [&] {
    while (const std::optional<LogScan> scan = sorter.Pop()) {
      sorted.push_back(scan->stamp_ns / 1'000'000);
    }
  };
  for (const std::int64_t stamp_ms : stamps_ms) {
    sorter.Push(At(stamp_ms));
    drain();
  }
  sorter.Finish();
  drain();
  return sorted;
}

TEST(StampSorterTest, KeepsAnOrderedLogAsItIs) {
  StampSorter sorter;
  EXPECT_EQ(Sorted(sorter, {1, 500, 1000, 9000}), (std::vector<std::int64_t>{1, 500, 1000, 9000}));
  EXPECT_EQ(sorter.moved_count(), 0U);
  EXPECT_EQ(sorter.late_count(), 0U);
}

TEST(StampSorterTest, MovesAndCountsScansWhoseStampsGoBackWithinTheWindow) {
  StampSorter sorter;
  EXPECT_EQ(Sorted(sorter, {1000, 2000, 1500, 3000, 1200, 5000}),
            (std::vector<std::int64_t>{1000, 1200, 1500, 2000, 3000, 5000}));
  EXPECT_EQ(sorter.moved_count(), 2U);
}

TEST(StampSorterTest, LetsAScanThatIsLaterThanTheWindowThroughAndCountsIt) {
  StampSorter sorter;
  EXPECT_EQ(Sorted(sorter, {1000, 2000, 4500, 500, 4600}),
            (std::vector<std::int64_t>{1000, 2000, 500, 4500, 4600}));
  EXPECT_EQ(sorter.late_count(), 1U);
  EXPECT_EQ(sorter.moved_count(), 0U);
}

TEST(StampSorterTest, KeepsTheOrderOfEqualStamps) {
  StampSorter sorter;
  sorter.Push(At(10, 1));
  sorter.Push(At(10, 2));
  sorter.Finish();
  EXPECT_EQ(sorter.Pop()->line, 1U);
  EXPECT_EQ(sorter.Pop()->line, 2U);
  EXPECT_FALSE(sorter.Pop().has_value());
}

TEST(StampSorterTest, OrdersAnyShuffleThatStaysWithinTheWindow) {
  RandomSequence random(7);
  for (int round = 0; round < 50; ++round) {
    std::vector<std::int64_t> stamps_ms;
    for (std::int64_t i = 0; i < 200; ++i) {
      stamps_ms.push_back(i * 100 + static_cast<std::int64_t>(random.NextUniform(0.0, 1900.0)));
    }
    StampSorter sorter;
    const std::vector<std::int64_t> sorted = Sorted(sorter, stamps_ms);
    ASSERT_EQ(sorted.size(), stamps_ms.size());
    EXPECT_TRUE(std::is_sorted(sorted.begin(), sorted.end()));
    EXPECT_EQ(sorter.late_count(), 0U);
  }
}

}  // namespace
}  // namespace loci
