// SPDX-License-Identifier: Apache-2.0
#include "server/map_host.h"

#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/grids.h"
#include "tests/support/hosted_maps.h"
#include "tests/support/matchers.h"
#include "tests/support/room_drive.h"

namespace loci {
namespace {

using ::testing::HasSubstr;

constexpr std::size_t kDriveLength = 160;

// Streams the whole drive in batches of this size and gives the digest after the close.
std::string StreamAll(HostedMaps& maps, const std::string& map, std::size_t batch_size) {
  const std::vector<ObservationEvent> drive = RoomDrive(kDriveLength);
  EXPECT_THAT(maps->Create(map, {}), IsOk());
  EXPECT_THAT(maps.OpenSession(map, "s"), IsOk());
  for (std::size_t begin = 0; begin < drive.size(); begin += batch_size) {
    EXPECT_THAT(maps.Append(map, "s", drive, begin, std::min(drive.size(), begin + batch_size)),
                IsOk());
  }
  EXPECT_THAT(maps.CloseSession(map, "s"), IsOk());
  return maps.Digest(map);
}

TEST(MapHostTest, LosesNothingAcknowledgedWhenKilledAfterAnyBatch) {
  const std::vector<ObservationEvent> drive = RoomDrive(kDriveLength);
  HostedMaps uninterrupted;
  const std::string digest = StreamAll(uninterrupted, "a", 10);

  HostLimits limits;
  limits.checkpoint_events = 37;
  HostedMaps maps(limits);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  for (std::size_t begin = 0; begin < drive.size(); begin += 10) {
    const StatusOr<AppendOutcome> outcome = maps.Append("a", "s", drive, begin, begin + 10);
    ASSERT_THAT(outcome, IsOk());
    maps.Restart(StopMode::kAbandon);
    const StatusOr<HostedSession> session = maps.Host("a")->FindSession("s");
    ASSERT_THAT(session, IsOk());
    EXPECT_EQ(session->last_durable_number, outcome->last_durable_number);
  }
  EXPECT_THAT(maps.CloseSession("a", "s"), IsOk());
  EXPECT_EQ(maps.Digest("a"), digest);
  maps.Restart(StopMode::kAbandon);
  EXPECT_EQ(maps.Digest("a"), digest);
}

TEST(MapHostTest, TheSameObservationsGiveTheSameDigestWhateverBatchesNamesAndCheckpoints) {
  HostedMaps maps;
  const std::string digest = StreamAll(maps, "first", 1);
  EXPECT_EQ(StreamAll(maps, "second", 7), digest);
  EXPECT_EQ(StreamAll(maps, "third", kDriveLength), digest);
  HostLimits limits;
  limits.checkpoint_events = 1;
  HostedMaps often_written(limits);
  EXPECT_EQ(StreamAll(often_written, "first", 13), digest);
}

TEST(MapHostTest, ACleanStopLeavesNothingToReplay) {
  HostedMaps maps;
  const std::string digest = StreamAll(maps, "a", 50);
  maps.Stop(StopMode::kCheckpoint);
  auto directory = OpenSqliteDirectory(maps.path());
  ASSERT_THAT(directory, IsOk());
  {
    auto store = (*directory)->Open("a");
    ASSERT_THAT(store, IsOk());
    const auto checkpoints = (*store)->ListCheckpoints();
    ASSERT_THAT(checkpoints, IsOk());
    ASSERT_FALSE(checkpoints->empty());
    EXPECT_EQ(checkpoints->back().last_event, (*store)->LastEvent());
    EXPECT_EQ(checkpoints->back().state_digest, digest);
  }
  directory->reset();
  maps.Start();
}

TEST(MapHostTest, AnObservationThatIsNotNewerConsumesItsNumberAndIsNamed) {
  HostedMaps maps;
  std::vector<ObservationEvent> drive = RoomDrive(6);
  drive[3].stamp_ns = drive[2].stamp_ns;
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  const StatusOr<AppendOutcome> outcome = maps.Append("a", "s", drive, 0, 6);
  ASSERT_THAT(outcome, IsOk());
  EXPECT_EQ(outcome->last_durable_number, 6U);
  ASSERT_EQ(outcome->refused.size(), 1U);
  EXPECT_EQ(outcome->refused[0].number, 4U);
  EXPECT_THAT(outcome->refused[0].reason, HasSubstr("stamp_ns"));
  const StatusOr<HostedSession> closed = maps.CloseSession("a", "s");
  ASSERT_THAT(closed, IsOk());
  EXPECT_EQ(closed->session.accepted_count, 5U);
  EXPECT_EQ(closed->session.refused_count, 1U);
}

TEST(MapHostTest, ABatchMayBeSentAgain) {
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(20);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  ASSERT_THAT(maps.Append("a", "s", drive, 0, 10), IsOk());
  const std::string digest = maps.Digest("a");
  const StatusOr<AppendOutcome> again = maps.Append("a", "s", drive, 0, 10);
  ASSERT_THAT(again, IsOk());
  EXPECT_EQ(again->last_durable_number, 10U);
  EXPECT_EQ(maps.Digest("a"), digest);
  const StatusOr<AppendOutcome> overlapping = maps.Append("a", "s", drive, 5, 20);
  ASSERT_THAT(overlapping, IsOk());
  EXPECT_EQ(overlapping->last_durable_number, 20U);
  ASSERT_THAT(maps.CloseSession("a", "s"), IsOk());
  EXPECT_THAT(maps.Append("a", "s", drive, 5, 20), IsOk());  // durable before the close
  EXPECT_EQ(maps.Info("a")->last_event.value, 1U + 1U + 20U + 1U);
}

TEST(MapHostTest, AGapIsRefusedWithTheNumberExpectedNext) {
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(20);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  EXPECT_THAT(maps.Append("a", "s", drive, 0, 4), IsStatus(StatusCode::kNotFound, "\"s\""));
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  ASSERT_THAT(maps.Append("a", "s", drive, 0, 4), IsOk());
  const std::string digest = maps.Digest("a");
  EXPECT_THAT(maps.Append("a", "s", drive, 7, 9),
              IsStatus(StatusCode::kFailedPrecondition, "expected next is 5"));
  EXPECT_EQ(maps.Digest("a"), digest);
}

TEST(MapHostTest, OneInvalidObservationRefusesItsBatchAsAWhole) {
  HostedMaps maps;
  std::vector<ObservationEvent> drive = RoomDrive(5);
  drive[3].scan->angle_step_rad = -1.0;
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  const std::string digest = maps.Digest("a");
  EXPECT_THAT(maps.Append("a", "s", drive, 0, 5),
              IsStatus(StatusCode::kInvalidArgument, "observations[3].scan.angle_step_rad"));
  EXPECT_EQ(maps.Digest("a"), digest);
  EXPECT_EQ(maps.Host("a")->FindSession("s")->last_durable_number, 0U);
}

TEST(MapHostTest, ASessionIsFoundOpenAgainOnlyByItsRobotAndStart) {
  HostedMaps maps;
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  const auto other_robot = HostedMaps::Await<HostedSession>([&](auto done) {
    maps.Host("a")->OpenSession("s", {"other", {}}, std::move(done));
  });
  EXPECT_THAT(other_robot, IsStatus(StatusCode::kAlreadyExists, "robot"));
  const auto other_start = HostedMaps::Await<HostedSession>([&](auto done) {
    maps.Host("a")->OpenSession("s", {"robot", {1.0, 0.0, 0.0}}, std::move(done));
  });
  EXPECT_THAT(other_start, IsStatus(StatusCode::kAlreadyExists, "map_from_start"));
  ASSERT_THAT(maps.CloseSession("a", "s"), IsOk());
  ASSERT_THAT(maps.CloseSession("a", "s"), IsOk());
  EXPECT_THAT(maps.OpenSession("a", "s"), IsStatus(StatusCode::kAlreadyExists, "closed"));
}

TEST(MapHostTest, AfterACloseEverythingOfTheSessionIsPublished) {
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(100);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  ASSERT_THAT(maps.Append("a", "s", drive, 0, 100), IsOk());
  const StatusOr<HostedSession> closed = maps.CloseSession("a", "s");
  ASSERT_THAT(closed, IsOk());
  EXPECT_FALSE(closed->session.open);
  EXPECT_EQ(closed->session.last_number, 100U);
  const auto snapshot = maps->FindSnapshot("a", Revision{});
  ASSERT_THAT(snapshot, IsOk());
  EXPECT_EQ((*snapshot)->revision.value, 103U);
  EXPECT_EQ(closed->revision, (*snapshot)->revision);
}

TEST(MapHostTest, APinnedRevisionStaysAsItWasWhileWritesGoOn) {
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(120);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  ASSERT_THAT(maps.Append("a", "s", drive, 0, 30), IsOk());
  ASSERT_THAT(maps.Info("a"), IsOk());
  const auto pinned = maps->FindSnapshot("a", Revision{});
  ASSERT_THAT(pinned, IsOk());
  const std::size_t cells = ObservedCount((*pinned)->overlays.at(0).stationary);
  for (std::size_t begin = 30; begin < 120; begin += 5) {
    ASSERT_THAT(maps.Append("a", "s", drive, begin, begin + 5), IsOk());
    const auto again = maps->FindSnapshot("a", (*pinned)->revision);
    ASSERT_THAT(again, IsOk());
    EXPECT_EQ(*again, *pinned);
    EXPECT_EQ(ObservedCount((*again)->overlays.at(0).stationary), cells);
  }
  EXPECT_THAT(maps->FindSnapshot("a", Revision{9999}), IsStatus(StatusCode::kNotFound, "9999"));
}

TEST(MapHostTest, AFullDiskRefusesAndTheMapGoesOnWhenThereIsRoom) {
  HostedMaps undisturbed;
  const std::string digest = StreamAll(undisturbed, "a", 10);
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(kDriveLength);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  ASSERT_THAT(maps.Append("a", "s", drive, 0, 20), IsOk());
  maps.faults().append = StatusCode::kResourceExhausted;
  EXPECT_THAT(maps.Append("a", "s", drive, 20, 40), IsStatus(StatusCode::kResourceExhausted, "a"));
  EXPECT_THAT(maps.OpenSession("a", "other"), IsStatus(StatusCode::kResourceExhausted));
  EXPECT_THAT(maps.CloseSession("a", "s"), IsStatus(StatusCode::kResourceExhausted));
  EXPECT_THAT(maps->Create("b", {}), IsStatus(StatusCode::kResourceExhausted));
  EXPECT_EQ(maps.Host("a")->FindSession("s")->last_durable_number, 20U);
  EXPECT_THAT(maps->FindSnapshot("a", Revision{}), IsOk());
  maps.faults().append = StatusCode::kOk;
  EXPECT_THAT(maps->Create("b", {}), IsOk());
  ASSERT_THAT(maps.Append("a", "s", drive, 20, drive.size()), IsOk());
  ASSERT_THAT(maps.CloseSession("a", "s"), IsOk());
  EXPECT_EQ(maps.Digest("a"), digest);
}

TEST(MapHostTest, AfterTheDiskFailedReadsGoOnAndWritesSayWhatToDo) {
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(20);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  maps.faults().append = StatusCode::kUnavailable;
  EXPECT_THAT(maps.Append("a", "s", drive, 0, 10), IsStatus(StatusCode::kUnavailable));
  maps.faults().append = StatusCode::kOk;
  EXPECT_THAT(maps.Append("a", "s", drive, 0, 10),
              IsStatus(StatusCode::kUnavailable, "started again"));
  EXPECT_THAT(maps->FindSnapshot("a", Revision{}), IsOk());
  EXPECT_THAT(maps->Maps().at(0).problem, HasSubstr("started again"));
  maps.Restart(StopMode::kAbandon);
  EXPECT_THAT(maps.Append("a", "s", drive, 0, 10), IsOk());
}

TEST(MapHostTest, ACheckpointThatCannotBeWrittenCostsNothingButReplay) {
  HostLimits limits;
  limits.checkpoint_events = 10;
  limits.checkpoint_retry = Duration::zero();
  HostedMaps maps(limits);
  maps.faults().checkpoint = StatusCode::kResourceExhausted;
  const std::string digest = StreamAll(maps, "a", 10);
  maps.faults().checkpoint = StatusCode::kOk;
  maps.Restart(StopMode::kAbandon);
  EXPECT_EQ(maps.Digest("a"), digest);
  maps.Restart(StopMode::kCheckpoint);
  EXPECT_EQ(maps.Digest("a"), digest);
  EXPECT_GE(maps.faults().checkpoints_written, 1U);
}

TEST(MapHostTest, ADamagedCheckpointIsReplacedByAnOlderOneAndALongerReplay) {
  HostLimits limits;
  limits.checkpoint_events = 20;
  HostedMaps maps(limits);
  const std::string digest = StreamAll(maps, "a", 10);
  maps.Stop(StopMode::kCheckpoint);
  maps.faults().newest_checkpoint_damaged = true;
  maps.Start();
  EXPECT_EQ(maps.Digest("a"), digest);
}

TEST(MapHostTest, EventsThatAreReplayedCountForTheNextCheckpoint) {
  HostLimits limits;
  limits.checkpoint_events = 1000;
  HostedMaps maps(limits);
  const std::string digest = StreamAll(maps, "a", 10);
  EXPECT_EQ(maps.Host("a")->CurrentStatus().last_checkpoint, 0U);
  maps.limits().checkpoint_events = 20;
  maps.Restart(StopMode::kAbandon);
  // Nothing comes; what was replayed is enough.
  while (maps.Host("a")->CurrentStatus().last_checkpoint == 0) {
    std::this_thread::yield();
  }
  maps.Restart(StopMode::kAbandon);
  EXPECT_EQ(maps.Host("a")->CurrentStatus().events_replayed, 0U);
  EXPECT_EQ(maps.Digest("a"), digest);
}

TEST(MapHostTest, ADamagedCheckpointIsWrittenAnewAtTheNextStopThoughNothingChanged) {
  HostLimits limits;
  limits.checkpoint_events = 20;
  HostedMaps maps(limits);
  const std::string digest = StreamAll(maps, "a", 10);
  const std::uint64_t last_event = maps.Info("a")->last_event.value;
  maps.Stop(StopMode::kCheckpoint);
  maps.faults().newest_checkpoint_damaged = true;
  maps.Start();
  MapStatus status = maps.Host("a")->CurrentStatus();
  EXPECT_LT(status.recovered_from, last_event);
  EXPECT_EQ(status.recovered_from + status.events_replayed, last_event);
  maps.Stop(StopMode::kCheckpoint);
  maps.faults().newest_checkpoint_damaged = false;
  maps.Start();
  status = maps.Host("a")->CurrentStatus();
  EXPECT_EQ(status.recovered_from, last_event);
  EXPECT_EQ(status.events_replayed, 0U);
  EXPECT_EQ(maps.Digest("a"), digest);
  EXPECT_THAT(maps.Host("a")->Verify([] { return false; }), IsOk());
}

TEST(MapHostTest, TheStateIsHashedOncePerEventHoweverOftenItsDigestIsAskedFor) {
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(20);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  ASSERT_THAT(maps.Append("a", "s", drive, 0, 10), IsOk());
  const std::uint64_t before = maps.Host("a")->CurrentStatus().digests;
  const std::string digest = maps.Digest("a");
  EXPECT_EQ(maps.Digest("a"), digest);
  std::vector<std::future<StatusOr<HostedMapInfo>>> asked_at_once;
  for (int i = 0; i < 20; ++i) {
    asked_at_once.push_back(std::async(std::launch::async, [&] { return maps.Info("a"); }));
  }
  for (auto& answer : asked_at_once) {
    EXPECT_EQ(answer.get()->state_digest, digest);
  }
  EXPECT_THAT(maps.Host("a")->Verify([] { return false; }), IsOk());
  EXPECT_EQ(maps.Host("a")->CurrentStatus().digests, before + 1);

  ASSERT_THAT(maps.Append("a", "s", drive, 10, 11), IsOk());
  EXPECT_NE(maps.Digest("a"), digest);
  EXPECT_EQ(maps.Host("a")->CurrentStatus().digests, before + 2);
}

TEST(MapHostTest, VerificationReplaysFromTheOldestCheckpointToTheServedDigest) {
  HostLimits limits;
  limits.checkpoint_events = 25;
  HostedMaps maps(limits);
  const std::string digest = StreamAll(maps, "a", 10);
  maps.Restart(StopMode::kCheckpoint);
  const auto report = maps.Host("a")->Verify([] { return false; });
  ASSERT_THAT(report, IsOk());
  EXPECT_EQ(report->state_digest, digest);
  EXPECT_EQ(report->last_event.value, kDriveLength + 3);
  EXPECT_EQ(report->replayed_from.value + report->events_replayed, report->last_event.value);
  EXPECT_GT(report->events_replayed, 0U);
  EXPECT_THAT(maps.Host("a")->Verify([] { return true; }), IsStatus(StatusCode::kCancelled));
}

TEST(MapHostTest, SessionsAreAppendedInTurn) {
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(10);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  for (const std::string session : {"x", "y", "z"}) {
    ASSERT_THAT(maps.OpenSession("a", session), IsOk());
  }
  // While one append is held up, the batches of all sessions come to wait.
  const std::uint64_t begun = maps.faults().appends_begun;
  maps.faults().append_held = true;
  std::vector<std::future<StatusOr<AppendOutcome>>> answers;
  for (const std::string session : {"z", "x", "y"}) {
    auto answer = std::make_shared<std::promise<StatusOr<AppendOutcome>>>();
    answers.push_back(answer->get_future());
    maps.Host("a")->AppendBatch(
        session, {1, drive}, [answer](auto outcome) { answer->set_value(std::move(outcome)); });
    maps.faults().appends_begun.wait(begun);
  }
  maps.faults().append_held = false;
  maps.faults().append_held.notify_all();
  for (auto& answer : answers) {
    EXPECT_THAT(answer.get(), IsOk());
  }
  maps.Stop(StopMode::kAbandon);
  auto directory = OpenSqliteDirectory(maps.path());
  ASSERT_THAT(directory, IsOk());
  auto store = (*directory)->Open("a");
  ASSERT_THAT(store, IsOk());
  std::vector<std::uint32_t> turns;
  const auto visit = [&](const LogEntry& entry) -> Status {
    const StatusOr<Event> event = DecodeEvent(entry.bytes);
    if (const auto* observation = std::get_if<ObservationEvent>(&event.value());
        observation != nullptr) {
      turns.push_back(observation->session.value);
    }
    return {};
  };
  ASSERT_THAT((*store)->ReadLog(EventNumber{0}, visit), IsOk());
  // The first group had only z's batch; then x and y take turns.
  ASSERT_EQ(turns.size(), 30U);
  for (std::size_t i = 10; i + 1 < turns.size(); ++i) {
    EXPECT_NE(turns[i], turns[i + 1]) << i;
  }
}

TEST(MapHostTest, AFullWindowIsAnsweredAndNothingIsLost) {
  HostLimits limits;
  limits.session_window_bytes = 2000;
  HostedMaps maps(limits);
  const std::vector<ObservationEvent> drive = RoomDrive(200);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  std::vector<std::future<StatusOr<AppendOutcome>>> answers;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    auto answer = std::make_shared<std::promise<StatusOr<AppendOutcome>>>();
    answers.push_back(answer->get_future());
    maps.Host("a")->AppendBatch("s", {i + 1, {drive[i]}}, [answer](auto outcome) {
      answer->set_value(std::move(outcome));
    });
  }
  std::uint64_t durable = 0;
  for (auto& answer : answers) {
    const StatusOr<AppendOutcome> outcome = answer.get();
    if (outcome.ok()) {
      EXPECT_EQ(outcome->last_durable_number, ++durable);
    } else {
      EXPECT_THAT(outcome,
                  testing::AnyOf(IsStatus(StatusCode::kResourceExhausted, "window"),
                                 IsStatus(StatusCode::kFailedPrecondition, "expected next")));
    }
  }
  EXPECT_EQ(maps.Host("a")->FindSession("s")->last_durable_number, durable);
}

}  // namespace
}  // namespace loci
