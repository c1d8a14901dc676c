// SPDX-License-Identifier: Apache-2.0
#include "server/host/snapshot_ring.h"

#include <chrono>
#include <memory>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace loci {
namespace {

std::shared_ptr<const Snapshot> SnapshotOf(std::uint64_t revision) {
  auto snapshot = std::make_shared<Snapshot>();
  snapshot->revision = Revision{revision};
  return snapshot;
}

class SnapshotRingTest : public testing::Test {
 protected:
  SnapshotRingTest() {
    limits_.snapshots_recent_max = 2;
    limits_.snapshots_answered_max = 3;
    limits_.snapshots_pinned_max = 2;
    limits_.snapshot_kept = std::chrono::seconds(10);
  }

  HostLimits limits_;
  ManualClock clock_;
};

TEST_F(SnapshotRingTest, KeepsTheNewestAndThoseBeforeItThatAreRecent) {
  SnapshotRing ring(limits_, clock_);
  EXPECT_EQ(ring.Newest(), nullptr);
  for (std::uint64_t revision = 1; revision <= 5; ++revision) {
    ring.Publish(SnapshotOf(revision));
  }
  EXPECT_EQ(ring.Peek()->revision.value, 5U);
  EXPECT_THAT(ring.Find(Revision{4}), IsOk());
  EXPECT_THAT(ring.Find(Revision{3}), IsStatus(StatusCode::kNotFound, "revision: 3"));
  EXPECT_THAT(ring.Find(Revision{6}), IsStatus(StatusCode::kNotFound, "revision: 6"));
}

TEST_F(SnapshotRingTest, KeepsARevisionThatAReaderWasAnsweredFor) {
  SnapshotRing ring(limits_, clock_);
  ring.Publish(SnapshotOf(1));
  EXPECT_EQ(ring.Newest()->revision.value, 1U);
  for (std::uint64_t revision = 2; revision <= 100; ++revision) {
    ring.Publish(SnapshotOf(revision));
  }
  EXPECT_THAT(ring.Find(Revision{1}), IsOk());
  clock_.Advance(std::chrono::seconds(9));
  EXPECT_THAT(ring.Find(Revision{1}), IsOk());
  clock_.Advance(std::chrono::seconds(9));
  ring.Publish(SnapshotOf(101));
  EXPECT_THAT(ring.Find(Revision{1}), IsOk()) << "asked for 9 s ago";
  clock_.Advance(std::chrono::seconds(11));
  ring.Publish(SnapshotOf(102));
  EXPECT_THAT(ring.Find(Revision{1}), IsStatus(StatusCode::kNotFound));
}

TEST_F(SnapshotRingTest, APinnedRevisionIsNotPushedOutByAnswersToOthers) {
  SnapshotRing ring(limits_, clock_);
  ring.Publish(SnapshotOf(1));
  ASSERT_THAT(ring.Find(Revision{1}), IsOk());
  for (std::uint64_t revision = 2; revision <= 50; ++revision) {
    clock_.Advance(std::chrono::milliseconds(10));
    ring.Publish(SnapshotOf(revision));
    ring.Newest();
  }
  EXPECT_THAT(ring.Find(Revision{1}), IsOk());
  EXPECT_THAT(ring.Find(Revision{20}), IsStatus(StatusCode::kNotFound)) << "one answer of many";
}

TEST_F(SnapshotRingTest, OfTooManyPinnedRevisionsTheLeastRecentlyAskedForGoes) {
  SnapshotRing ring(limits_, clock_);
  for (std::uint64_t revision = 1; revision <= 9; ++revision) {
    ring.Publish(SnapshotOf(revision));
    ASSERT_THAT(ring.Find(Revision{revision}), IsOk());
    clock_.Advance(std::chrono::milliseconds(1));
  }
  ring.Publish(SnapshotOf(10));
  EXPECT_THAT(ring.Find(Revision{7}), IsStatus(StatusCode::kNotFound));
  EXPECT_THAT(ring.Find(Revision{8}), IsOk());
  EXPECT_THAT(ring.Find(Revision{9}), IsOk());
  EXPECT_THAT(ring.Find(Revision{10}), IsOk());
}

}  // namespace
}  // namespace loci
