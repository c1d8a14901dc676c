// SPDX-License-Identifier: Apache-2.0
#include "server/base/job_queue.h"

#include <atomic>
#include <future>
#include <latch>
#include <memory>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace loci {
namespace {

TEST(JobQueueTest, RunsSoManyAtATimeAndTheOthersInOrder) {
  std::latch both_run(2);
  std::promise<void> may_end;
  const std::shared_future<void> end = may_end.get_future().share();
  std::atomic<int> next = 0;
  std::vector<int> order(3);
  std::latch done(5);
  JobQueue queue("jobs", 2, 3);
  for (int i = 0; i < 2; ++i) {
    ASSERT_THAT(queue.Submit([&] {
      both_run.count_down();
      end.wait();
      done.count_down();
    }),
                IsOk());
  }
  both_run.wait();
  for (std::size_t i = 0; i < 3; ++i) {
    ASSERT_THAT(queue.Submit([&, i] {
      order[i] = next++;
      done.count_down();
    }),
                IsOk());
  }
  EXPECT_EQ(next, 0);
  EXPECT_THAT(queue.Submit([] { FAIL() << "was refused"; }),
              IsStatus(StatusCode::kResourceExhausted, "jobs: 2 run and 3 wait already"));
  may_end.set_value();
  done.wait();
  EXPECT_EQ(order[0], 0);
}

TEST(JobQueueTest, WithoutPlacesToWaitAJobIsRefusedWhileAnotherRunsAndTakenAfterwards) {
  std::latch runs(1);
  std::promise<void> may_end;
  JobQueue queue("jobs", 1, 0);
  ASSERT_THAT(queue.Submit([&] {
    runs.count_down();
    may_end.get_future().wait();
  }),
              IsOk());
  runs.wait();
  EXPECT_THAT(queue.Submit([] {}), IsStatus(StatusCode::kResourceExhausted, "1 run and 0 wait"));
  may_end.set_value();
  std::promise<void> ran;
  while (!queue.Submit([&] { ran.set_value(); }).ok()) {
    std::this_thread::yield();
  }
  ran.get_future().wait();
}

TEST(JobQueueTest, AtTheEndJobsThatWaitAreDroppedWithAllTheyHold) {
  const auto held = std::make_shared<int>(0);
  std::latch runs(1);
  std::promise<void> may_end;
  std::jthread ends_it;
  {
    JobQueue queue("jobs", 1, 10);
    ASSERT_THAT(queue.Submit([&] {
      runs.count_down();
      may_end.get_future().wait();
    }),
                IsOk());
    runs.wait();
    ASSERT_THAT(queue.Submit([held] { ++*held; }), IsOk());
    // The queue's end drops the waiting job first: only then the running one may end.
    ends_it = std::jthread([&] {
      while (held.use_count() > 1) {
        std::this_thread::yield();
      }
      may_end.set_value();
    });
  }
  EXPECT_EQ(*held, 0);
  EXPECT_EQ(held.use_count(), 1);
}

}  // namespace
}  // namespace loci
