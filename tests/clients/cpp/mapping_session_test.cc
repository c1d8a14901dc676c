// SPDX-License-Identifier: Apache-2.0
// What is appended is durable once, in order, whatever the server and the connection do.
#include "clients/cpp/mapping_session.h"

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "server/rpc/dispatcher.h"
#include "server/transport/memory_transport.h"
#include "tests/support/matchers.h"
#include "tests/support/memory_link.h"
#include "tests/support/rpc_server.h"

namespace loci {
namespace {

using client::MappingSession;
using client::MappingSessionOptions;
using std::chrono::milliseconds;

// The rules of loci.v1.Mapping, on a disk of memory that outlives its server.
class Disk {
 public:
  void Register(Dispatcher& dispatcher) {
    dispatcher.AddService("loci.v1.Mapping");
    Add<v1::OpenSessionRequest, v1::SessionState>(dispatcher, "OpenSession", &Disk::OpenSession);
    Add<v1::AppendBatchRequest, v1::AppendBatchResponse>(dispatcher, "AppendBatch", &Disk::Append);
    Add<v1::GetSessionRequest, v1::SessionState>(dispatcher, "GetSession", &Disk::GetSession);
    Add<v1::ListSessionsRequest, v1::ListSessionsResponse>(dispatcher, "ListSessions", &Disk::List);
    Add<v1::CloseSessionRequest, v1::SessionState>(dispatcher, "CloseSession", &Disk::Close);
  }

  std::vector<std::int64_t> stamps() {
    const std::lock_guard lock(mutex_);
    return stamps_;
  }
  std::size_t size() { return stamps().size(); }
  // The next `count` batches fail with `status`.
  void FailAppends(int count, Status status) {
    const std::lock_guard lock(mutex_);
    fail_count_ = count;
    failure_ = std::move(status);
  }
  // Batches are kept waiting while `held`.
  std::atomic<bool> held{false};
  std::atomic<int> opened{0};

 private:
  template <typename Request, typename Response>
  void Add(Dispatcher& dispatcher,
           const std::string& method,
           StatusOr<Response> (Disk::*handler)(const Request&)) {
    dispatcher.AddUnary<Request, Response>(
        "loci.v1.Mapping/" + method,
        Execution::kOrdered,
        [this, handler](ServerCall& call, const Request& request) -> StatusOr<Response> {
          if constexpr (std::is_same_v<Request, v1::AppendBatchRequest>) {
            while (held && !call.over()) {
              std::this_thread::yield();
            }
          }
          const std::lock_guard lock(mutex_);
          return (this->*handler)(request);
        });
  }

  v1::SessionState State() {
    v1::SessionState state;
    state.set_open(open_);
    state.set_last_durable_number(stamps_.size());
    return state;
  }
  StatusOr<v1::SessionState> OpenSession(const v1::OpenSessionRequest&) {
    ++opened;
    return State();
  }
  StatusOr<v1::SessionState> GetSession(const v1::GetSessionRequest&) { return State(); }
  StatusOr<v1::ListSessionsResponse> List(const v1::ListSessionsRequest&) {
    return v1::ListSessionsResponse();
  }
  StatusOr<v1::SessionState> Close(const v1::CloseSessionRequest&) {
    open_ = false;
    return State();
  }
  StatusOr<v1::AppendBatchResponse> Append(const v1::AppendBatchRequest& request) {
    if (fail_count_ > 0) {
      --fail_count_;
      return failure_;
    }
    if (request.first_number() > stamps_.size() + 1) {
      return FailedPreconditionError("expected number " + std::to_string(stamps_.size() + 1));
    }
    v1::AppendBatchResponse response;
    for (int i = 0; i < request.observations_size(); ++i) {
      const std::uint64_t number = request.first_number() + static_cast<std::uint64_t>(i);
      if (number <= stamps_.size()) {
        continue;
      }
      stamps_.push_back(request.observations(i).stamp_ns());
      if (request.observations(i).stamp_ns() % 100 == 99) {
        v1::RefusedObservation& refused = *response.add_refused();
        refused.set_number(number);
        refused.set_reason("its stamp ends in 99");
      }
    }
    response.set_last_durable_number(stamps_.size());
    response.set_revision(stamps_.size());
    response.mutable_map_from_odom()->set_x(static_cast<double>(stamps_.size()));
    return response;
  }

  std::mutex mutex_;
  bool open_ = true;
  std::vector<std::int64_t> stamps_;
  int fail_count_ = 0;
  Status failure_;
};

class MappingSessionTest : public testing::Test {
 protected:
  MappingSessionTest() { StartServer(); }
  ~MappingSessionTest() override {
    channel_.reset();
    StopServer();
  }

  void StartServer(const MemoryTransportOptions& network = {}) {
    auto transport = std::make_unique<MemoryTransport>(network, clock_);
    dispatcher_.emplace(DispatcherOptions(), clock_);
    disk_.Register(*dispatcher_);
    ASSERT_THAT(dispatcher_->Start(*transport), IsOk());
    const std::lock_guard lock(mutex_);
    transport_ = std::move(transport);
  }
  // As if killed: what is in flight is lost.
  void StopServer() {
    std::shared_ptr<MemoryTransport> transport;
    {
      const std::lock_guard lock(mutex_);
      transport = std::exchange(transport_, nullptr);
    }
    if (transport != nullptr) {
      dispatcher_->Stop(Duration::zero());
      dispatcher_.reset();
    }
  }

  std::unique_ptr<MappingSession> Open(MappingSessionOptions options = {}) {
    options.map = "m";
    options.session = "s";
    options.robot = "r";
    if (channel_ == nullptr) {
      client::ChannelOptions channel_options;
      channel_options.backoff_min = milliseconds(1);
      channel_options.backoff_max = milliseconds(5);
      channel_options.link_factory = [this](const std::string&) {
        return std::make_unique<MemoryLink>([this]() -> std::unique_ptr<MemoryPeer> {
          const std::lock_guard lock(mutex_);
          return transport_ == nullptr ? nullptr : transport_->Connect();
        });
      };
      channel_ = client::Channel::Create("memory", channel_options);
    }
    auto session = MappingSession::Open(channel_, options);
    EXPECT_THAT(session, IsOk());
    return session.ok() ? std::move(session).value() : nullptr;
  }

  static v1::Observation At(std::int64_t stamp_ns) {
    v1::Observation observation;
    observation.set_stamp_ns(stamp_ns);
    return observation;
  }

  void ExpectStampsUpTo(std::int64_t count) {
    const std::vector<std::int64_t> stamps = disk_.stamps();
    ASSERT_EQ(stamps.size(), static_cast<std::size_t>(count));
    for (std::int64_t i = 0; i < count; ++i) {
      ASSERT_EQ(stamps[static_cast<std::size_t>(i)], i);
    }
  }

  const SteadyClock clock_;
  Disk disk_;
  std::optional<Dispatcher> dispatcher_;
  std::mutex mutex_;
  std::shared_ptr<MemoryTransport> transport_;
  std::shared_ptr<client::Channel> channel_;
};

TEST_F(MappingSessionTest, WhatIsAppendedIsDurableInOrder) {
  const auto session = Open();
  EXPECT_EQ(session->next_number(), 1U);
  for (std::int64_t i = 0; i < 5000; ++i) {
    ASSERT_THAT(session->Append(At(i)), IsOk());
  }
  ASSERT_THAT(session->Flush(), IsOk());
  ExpectStampsUpTo(5000);
  const client::MappingProgress progress = session->progress();
  EXPECT_EQ(progress.last_durable_number, 5000U);
  EXPECT_EQ(progress.last_appended_number, 5000U);
  EXPECT_EQ(progress.map_from_odom.x(), 5000.0);
  EXPECT_EQ(progress.interruptions, 0U);
  const auto state = session->Close();
  ASSERT_THAT(state, IsOk());
  EXPECT_FALSE(state->open());
}

TEST_F(MappingSessionTest, ASingleObservationLeavesAtOnce) {
  MappingSessionOptions options;
  options.batch_delay = std::chrono::hours(1);
  const auto session = Open(options);
  ASSERT_THAT(session->Append(At(0)), IsOk());
  EXPECT_TRUE(Eventually([&] { return session->progress().last_durable_number == 1; }));
}

TEST_F(MappingSessionTest, LosesNothingAndRepeatsNothingOverRestarts) {
  MappingSessionOptions options;
  options.batch_observations_max = 5;
  options.window_batches = 4;
  const auto session = Open(options);
  std::atomic<bool> done{false};
  std::thread killer([&] {
    RandomSequence random(3);
    for (int kill = 0; kill < 20; ++kill) {
      const std::size_t until = disk_.size() + random.NextBits() % 60;
      Eventually([&] { return done || disk_.size() >= until; });
      StopServer();
      StartServer();
    }
  });
  constexpr std::int64_t kCount = 3000;
  for (std::int64_t i = 0; i < kCount; ++i) {
    ASSERT_THAT(session->Append(At(i)), IsOk());
  }
  EXPECT_THAT(session->Flush(), IsOk());
  done = true;
  killer.join();
  ExpectStampsUpTo(kCount);
  EXPECT_THAT(session->Close(), IsOk());
}

TEST_F(MappingSessionTest, OutlivesRepeatedAndDelayedMessages) {
  StopServer();
  MemoryTransportOptions network;
  network.repeat_probability = 0.3;
  network.delay_max = std::chrono::microseconds(500);
  StartServer(network);
  MappingSessionOptions options;
  options.batch_observations_max = 7;
  const auto session = Open(options);
  for (std::int64_t i = 0; i < 2000; ++i) {
    ASSERT_THAT(session->Append(At(i)), IsOk());
  }
  ASSERT_THAT(session->Flush(), IsOk());
  ExpectStampsUpTo(2000);
}

TEST_F(MappingSessionTest, WaitsWhileTheServerHasNoRoom) {
  MappingSessionOptions options;
  std::atomic<int> troubles{0};
  options.on_trouble = [&](const std::string& what) {
    EXPECT_THAT(what, testing::HasSubstr("no space"));
    ++troubles;
  };
  const auto session = Open(options);
  disk_.FailAppends(3, ResourceExhaustedError("no space left on device"));
  for (std::int64_t i = 0; i < 500; ++i) {
    ASSERT_THAT(session->Append(At(i)), IsOk());
  }
  ASSERT_THAT(session->Flush(), IsOk());
  ExpectStampsUpTo(500);
  EXPECT_GE(troubles, 1);
}

TEST_F(MappingSessionTest, ItsWindowIsBounded) {
  MappingSessionOptions options;
  options.batch_observations_max = 10;
  options.window_batches = 3;
  options.batch_delay = milliseconds(0);
  const auto session = Open(options);
  disk_.held = true;
  std::thread robot([&] {
    for (std::int64_t i = 0; i < 1000; ++i) {
      EXPECT_THAT(session->Append(At(i)), IsOk());
    }
  });
  std::uint64_t before = 0;
  EXPECT_TRUE(Eventually([&] {
    const std::uint64_t now = session->progress().last_appended_number;
    EXPECT_LE(now, 4U * 10U);
    return now >= 10U && std::exchange(before, now) == now;
  }));
  disk_.held = false;
  robot.join();
  EXPECT_THAT(session->Flush(), IsOk());
  ExpectStampsUpTo(1000);
}

TEST_F(MappingSessionTest, AnErrorThatStaysEndsTheSession) {
  const auto session = Open();
  disk_.FailAppends(1000, InvalidArgumentError("observations[0].scan: no"));
  Status status;
  for (std::int64_t i = 0; i < 10'000 && status.ok(); ++i) {
    status = session->Append(At(i));
  }
  EXPECT_THAT(status, IsStatus(StatusCode::kInvalidArgument, "observations[0].scan"));
  EXPECT_THAT(session->Flush(), IsStatus(StatusCode::kInvalidArgument));
  EXPECT_THAT(session->Close().status(), IsStatus(StatusCode::kInvalidArgument));
}

TEST_F(MappingSessionTest, GivesUpWhenNothingMovesForTooLong) {
  MappingSessionOptions options;
  options.retry_for = milliseconds(200);
  const auto session = Open(options);
  disk_.FailAppends(1 << 30, ResourceExhaustedError("no space left on device"));
  ASSERT_THAT(session->Append(At(0)), IsOk());
  EXPECT_THAT(session->Flush(), IsStatus(StatusCode::kResourceExhausted, "no space"));
}

TEST_F(MappingSessionTest, TellsWhatWasRefused) {
  const auto session = Open();
  for (std::int64_t i = 0; i < 300; ++i) {
    ASSERT_THAT(session->Append(At(i)), IsOk());
  }
  ASSERT_THAT(session->Flush(), IsOk());
  EXPECT_EQ(session->progress().refused_count, 3U);
  const std::vector<client::Refusal> refusals = session->TakeRefusals();
  ASSERT_EQ(refusals.size(), 3U);
  EXPECT_EQ(refusals[0].number, 100U);
  EXPECT_EQ(refusals[0].reason, "its stamp ends in 99");
  EXPECT_TRUE(session->TakeRefusals().empty());
}

TEST_F(MappingSessionTest, GoesOnWhereAnEarlierRobotStopped) {
  {
    const auto session = Open();
    for (std::int64_t i = 0; i < 100; ++i) {
      ASSERT_THAT(session->Append(At(i)), IsOk());
    }
    ASSERT_THAT(session->Flush(), IsOk());
  }
  const auto session = Open();
  ASSERT_EQ(session->next_number(), 101U);
  for (std::int64_t i = 100; i < 200; ++i) {
    ASSERT_THAT(session->Append(At(i)), IsOk());
  }
  ASSERT_THAT(session->Flush(), IsOk());
  ExpectStampsUpTo(200);
}

TEST_F(MappingSessionTest, OpeningWaitsForTheServer) {
  StopServer();
  std::atomic<bool> troubled{false};
  MappingSessionOptions options;
  options.on_trouble = [&](const std::string&) { troubled = true; };
  std::thread starter([&] { StartServer(); });
  const auto session = Open(options);
  starter.join();
  ASSERT_NE(session, nullptr);
  EXPECT_EQ(disk_.opened, 1);
}

TEST_F(MappingSessionTest, OpeningWithoutPatienceFailsAtOnceWhenTheServerIsAway) {
  Open();
  StopServer();
  MappingSessionOptions options;
  options.map = "m";
  options.session = "s";
  options.robot = "r";
  options.retry_for = milliseconds(0);
  EXPECT_THAT(MappingSession::Open(channel_, options).status(), IsStatus(StatusCode::kUnavailable));
}

TEST_F(MappingSessionTest, ClosingGivesUpWhenTheServerStaysAway) {
  MappingSessionOptions options;
  options.retry_for = milliseconds(200);
  const auto session = Open(options);
  ASSERT_THAT(session->Append(At(0)), IsOk());
  ASSERT_THAT(session->Flush(), IsOk());
  StopServer();
  EXPECT_THAT(session->Close().status(), IsStatus(StatusCode::kUnavailable));
}

TEST_F(MappingSessionTest, ClosingWaitsForAServerThatComesBack) {
  const auto session = Open();
  ASSERT_THAT(session->Append(At(0)), IsOk());
  ASSERT_THAT(session->Flush(), IsOk());
  StopServer();
  std::thread starter([&] { StartServer(); });
  EXPECT_THAT(session->Close(), IsOk());
  starter.join();
}

}  // namespace
}  // namespace loci
