// SPDX-License-Identifier: Apache-2.0
#include "server/host/publisher.h"

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace loci {
namespace {

using ::testing::ElementsAre;

class PublisherTest : public testing::Test {
 protected:
  void Publish(std::uint64_t revision) {
    auto snapshot = std::make_shared<Snapshot>();
    snapshot->revision = Revision{revision};
    publisher_.Publish(std::move(snapshot), true);
  }

  ManualClock clock_;
  Publisher publisher_{"hall", HostLimits(), clock_};
};

TEST_F(PublisherTest, ASubscriberIsToldEveryRevisionFromNowOnAndTheEnd) {
  Publish(1);
  std::vector<std::uint64_t> revisions;
  bool ended = false;
  const auto subscription = publisher_.Subscribe([&](const RevisionChange& change) {
    EXPECT_EQ(change.map, "hall");
    EXPECT_FALSE(ended);
    revisions.push_back(change.snapshot->revision.value);
    ended = change.ended;
  });
  Publish(2);
  Publish(3);
  publisher_.End();
  EXPECT_TRUE(ended);
  EXPECT_THAT(revisions, ElementsAre(2, 3, 3));
}

TEST_F(PublisherTest, ASubscriberMayEndItselfWithinItsCallbackWhichIsThenTheLast) {
  int calls = 0;
  std::unique_ptr<Subscription> subscription;
  subscription = publisher_.Subscribe([&](const RevisionChange&) {
    subscription.reset();
    ++calls;
  });
  Publish(1);
  Publish(2);
  publisher_.End();
  EXPECT_EQ(calls, 1);
}

TEST_F(PublisherTest, ASubscriberMayEndItselfWhenItIsToldTheEnd) {
  std::unique_ptr<Subscription> subscription;
  subscription = publisher_.Subscribe([&](const RevisionChange& change) {
    if (change.ended) {
      subscription.reset();
    }
  });
  Publish(1);
  publisher_.End();
  EXPECT_EQ(subscription, nullptr);
}

TEST_F(PublisherTest, ASubscriberMayEndOthersAndBeginNewOnes) {
  int second_calls = 0;
  int third_calls = 0;
  std::unique_ptr<Subscription> second;
  std::unique_ptr<Subscription> third;
  const auto first = publisher_.Subscribe([&](const RevisionChange&) {
    second.reset();
    if (third == nullptr) {
      third = publisher_.Subscribe([&](const RevisionChange&) { ++third_calls; });
    }
  });
  second = publisher_.Subscribe([&](const RevisionChange&) { ++second_calls; });
  Publish(1);
  EXPECT_EQ(second_calls, 0);
  EXPECT_EQ(third_calls, 0);  // it began after the revision
  Publish(2);
  publisher_.End();
  EXPECT_EQ(second_calls, 0);
  EXPECT_EQ(third_calls, 2);  // revision 2 and the end
}

TEST_F(PublisherTest, WhatACallbackLetsGoMayEndItsSubscription) {
  // As a call does: what the callback holds last owns the subscription.
  struct Owner {
    std::unique_ptr<Subscription> subscription;
  };
  auto owner = std::make_shared<Owner>();
  int calls = 0;
  owner->subscription = publisher_.Subscribe(
      [&owner, &calls, weak = std::weak_ptr<Owner>(owner)](const RevisionChange&) {
        ++calls;
        const std::shared_ptr<Owner> held = weak.lock();
        owner.reset();
      });
  Publish(1);
  Publish(2);
  EXPECT_EQ(owner, nullptr);
  EXPECT_EQ(calls, 1);
}

TEST_F(PublisherTest, AfterASubscriptionEndedItsCallbackDoesNotRunWhateverIsPublishedMeanwhile) {
  std::atomic<bool> done{false};
  std::jthread writer([&] {
    for (std::uint64_t revision = 1; !done; ++revision) {
      Publish(revision);
    }
  });
  for (int round = 0; round < 200; ++round) {
    // Freed as soon as the subscription ended: a call after that would be one of freed memory.
    const auto calls = std::make_unique<std::atomic<int>>(0);
    const auto gone = std::make_shared<std::atomic<bool>>(false);
    auto subscription = publisher_.Subscribe([calls = calls.get(), gone](const RevisionChange&) {
      ++*calls;
      EXPECT_FALSE(*gone);
      std::this_thread::yield();
      EXPECT_FALSE(*gone);
    });
    while (*calls == 0) {
      std::this_thread::yield();
    }
    subscription.reset();
    *gone = true;
  }
  done = true;
}

TEST_F(PublisherTest, ASubscriptionMayOutliveItsPublisher) {
  std::unique_ptr<Subscription> subscription;
  {
    Publisher publisher("hall", HostLimits(), clock_);
    subscription = publisher.Subscribe([](const RevisionChange&) {});
  }
  subscription.reset();
}

}  // namespace
}  // namespace loci
