// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/call_table.h"

#include <atomic>
#include <memory>
#include <thread>
#include <utility>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/rpc_server.h"

namespace loci {
namespace {

// True once the workers are being stopped: what is posted then is not kept.
bool DropsTasks(CallTable& table) {
  auto task = std::make_shared<int>();
  const std::weak_ptr<int> kept = task;
  table.Post([held = std::move(task)] {});
  return kept.expired();
}

TEST(CallTableTest, CallsThatWaitForTheirTurnWhenTheServerStopsLeaveNothingBehind) {
  const SteadyClock clock;
  MethodCounters counters;
  DispatcherOptions options;
  options.worker_count = 1;
  auto table = std::make_shared<CallTable>(options, clock, std::make_shared<RpcCounters>());
  ServerCall::Request request;
  request.peer = "peer";
  request.call_id = 1;
  table->HearFrom(request.peer, clock.Now());
  StatusOr<std::shared_ptr<ServerCall>> call = table->Begin(request, counters);
  ASSERT_THAT(call, IsOk());
  std::atomic<bool> begun{false};
  std::atomic<bool> released{false};
  table->Post(request.peer, true, [&] {
    begun = true;
    while (!released) {
      std::this_thread::yield();
    }
  });
  // The turn of this one, which holds its call and so the table, never comes.
  std::atomic<bool> had_a_turn{false};
  table->Post(request.peer, true, [&had_a_turn, held = *call] { had_a_turn = true; });
  EXPECT_TRUE(Eventually([&] { return begun.load(); }));
  table->EndAll();
  std::thread stopping([&] { table->StopWorkers(); });
  EXPECT_TRUE(Eventually([&] { return DropsTasks(*table); }));
  released = true;
  stopping.join();
  EXPECT_FALSE(had_a_turn);
  const std::weak_ptr<CallTable> left = table;
  *call = nullptr;
  table = nullptr;
  EXPECT_TRUE(left.expired());
}

}  // namespace
}  // namespace loci
