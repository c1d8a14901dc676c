// SPDX-License-Identifier: Apache-2.0
// A map file after kills, power cuts, failing and full disks at every step of its life.
#include <csignal>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "storage/sqlite/sqlite_store.h"
#include "storage/store.h"
#include "tests/storage/store_content.h"
#include "tests/support/matchers.h"
#include "tests/support/simulated_disk.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

// What the script asks for, one after the other.
struct Action {
  enum class Kind : std::uint8_t { kAppend, kCheckpoint, kTrim };
  Kind kind;
  std::uint64_t number;  // append up to, checkpoint of, or trim up to this event
};
using Kind = Action::Kind;

// Groups of one and of many, checkpoints that add, change, remove and outdate, a trim.
const std::vector<Action> kScript = {
    {Kind::kAppend, 1},
    {Kind::kAppend, 6},
    {Kind::kCheckpoint, 6},
    {Kind::kAppend, 9},
    {Kind::kCheckpoint, 9},
    {Kind::kAppend, 40},
    {Kind::kCheckpoint, 40},
    {Kind::kTrim, 9},
    {Kind::kAppend, 41},
    {Kind::kAppend, 43},
    {Kind::kCheckpoint, 43},
    {Kind::kAppend, 44},
};

// Checkpoint `number` against the one before it.
CheckpointChanges ChangesOf(std::uint64_t number) {
  std::vector<StateRecord> written;
  for (std::uint64_t id = 0; id < 6; ++id) {
    written.push_back(Record(1, id, EventBytes(1000 * number + id) + EventBytes(number)));
  }
  written.push_back(Record(2, number, std::string(9000, static_cast<char>('a' + number % 20))));
  CheckpointChanges changes = Changes(number, std::move(written));
  changes.removed = {{2, 6}};
  if (number == 6) {
    changes.removed.clear();
  }
  return changes;
}

// The text of all of the script's checkpoints, by number.
std::map<std::uint64_t, std::string> ExpectedCheckpoints() {
  std::map<std::pair<std::uint32_t, std::uint64_t>, std::string> records;
  std::map<std::uint64_t, std::string> texts;
  for (const Action& action : kScript) {
    if (action.kind != Kind::kCheckpoint) {
      continue;
    }
    const CheckpointChanges changes = ChangesOf(action.number);
    for (const auto& name : changes.removed) {
      records.erase(name);
    }
    for (const StateRecord& record : changes.written) {
      records[{record.kind, record.id}] = record.bytes;
    }
    Checkpoint checkpoint{changes.last_event, changes.state_digest, {}};
    for (const auto& [name, bytes] : records) {
      checkpoint.records.push_back(Record(name.first, name.second, bytes));
    }
    texts[action.number] = Describe(checkpoint);
  }
  return texts;
}

// What the store has acknowledged, and what was asked for last.
struct Progress {
  std::uint64_t last_event = 0;
  std::uint64_t asked_event = 0;
  std::uint64_t checkpoint = 0;
  std::uint64_t asked_checkpoint = 0;
  std::uint64_t asked_trim = 0;
  std::size_t done = 0;  // actions
};

Status Do(const Action& action, MapStore& store, Progress& progress) {
  switch (action.kind) {
    case Kind::kAppend:
      progress.asked_event = action.number;
      LOCI_RETURN_IF_ERROR(store.Append(Entries(progress.last_event + 1, action.number)));
      progress.last_event = action.number;
      return {};
    case Kind::kCheckpoint:
      progress.asked_checkpoint = action.number;
      LOCI_RETURN_IF_ERROR(store.WriteCheckpoint(ChangesOf(action.number)));
      progress.checkpoint = action.number;
      return {};
    case Kind::kTrim:
      progress.asked_trim = action.number;
      return store.TrimLog({action.number});
  }
  return {};
}

// Goes on with the script until its end or an error.
Status RunScript(MapStore& store, Progress& progress) {
  for (; progress.done < kScript.size(); ++progress.done) {
    LOCI_RETURN_IF_ERROR(Do(kScript[progress.done], store, progress));
  }
  return {};
}

class SqliteRecoveryTest : public ::testing::Test {
 protected:
  void CreateMap() {
    temporary_.emplace(TemporaryDirectory::Medium::kMemory);
    disk_.emplace();
    OpenDirectory();
    store_ = directory_->Create("map").value();
  }
  void OpenDirectory() {
    // Parts so small and a write-ahead log so short that the script has several of each.
    directory_ = OpenSqliteDirectory(
                     temporary_->path(),
                     {.vfs = disk_->vfs_name(), .stage_size_bytes = 1000, .wal_frames_max = 12})
                     .value();
  }
  void Close() {
    store_.reset();
    directory_.reset();
  }
  void Reopen() {
    OpenDirectory();
    StatusOr<std::unique_ptr<MapStore>> opened = directory_->Open("map");
    ASSERT_THAT(opened, IsOk());
    store_ = std::move(opened).value();
  }
  // Steps of the whole script and of closing the map after it.
  std::uint64_t CountSteps() {
    CreateMap();
    const std::uint64_t before = disk_->steps();
    Progress progress;
    EXPECT_THAT(RunScript(*store_, progress), IsOk());
    Close();
    return disk_->steps() - before;
  }
  void ExpectNothingLost(const Progress& progress);
  void ExpectGoesOn();

  std::optional<TemporaryDirectory> temporary_;
  std::optional<SimulatedDisk> disk_;
  std::unique_ptr<StoreDirectory> directory_;
  std::unique_ptr<MapStore> store_;
};

void SqliteRecoveryTest::ExpectNothingLost(const Progress& progress) {
  static const std::map<std::uint64_t, std::string> expected = ExpectedCheckpoints();
  const std::uint64_t last = store_->LastEvent().value;
  EXPECT_TRUE(last == progress.last_event || last == progress.asked_event)
      << last << " of " << progress.last_event << ", " << progress.asked_event;

  std::uint64_t after = 0;
  const auto expect_entry = [&](const LogEntry& entry) {
    EXPECT_EQ(entry.number.value, ++after);
    EXPECT_EQ(entry.bytes, EventBytes(after));
    return Status();
  };
  const Status status = store_->ReadLog({0}, expect_entry);
  if (status.code() == StatusCode::kOutOfRange) {
    ASSERT_GT(progress.asked_trim, 0U);
    after = progress.asked_trim;
    ASSERT_THAT(store_->ReadLog({after}, expect_entry), IsOk());
  } else {
    ASSERT_THAT(status, IsOk());
  }
  EXPECT_EQ(after, last);

  const std::vector<CheckpointInfo> infos = store_->ListCheckpoints().value();
  const std::uint64_t newest = infos.empty() ? 0 : infos.back().last_event.value;
  EXPECT_TRUE(newest == progress.checkpoint || newest == progress.asked_checkpoint);
  EXPECT_EQ(infos.size(), newest == 0 ? 0U : newest == 6 ? 1U : 2U);
  for (const CheckpointInfo& info : infos) {
    const StatusOr<Checkpoint> checkpoint = store_->ReadCheckpoint(info.last_event);
    ASSERT_THAT(checkpoint, IsOk());
    EXPECT_EQ(Describe(*checkpoint), expected.at(info.last_event.value));
  }
  EXPECT_THAT(store_->CheckIntegrity(), IsOk());
}

void SqliteRecoveryTest::ExpectGoesOn() {
  const std::uint64_t next = store_->LastEvent().value + 1;
  ASSERT_THAT(store_->Append(Entries(next, next + 2)), IsOk());
  ASSERT_THAT(store_->WriteCheckpoint(Changes(next + 1, {Record(1, 3, "goes on")})), IsOk());
  EXPECT_THAT(store_->CheckIntegrity(), IsOk());
  EXPECT_EQ(store_->LastEvent(), EventNumber{next + 2});
}

TEST_F(SqliteRecoveryTest, LosesNothingAcknowledgedWhenKilledAtAnyWrite) {
  const std::uint64_t steps = CountSteps();
  ASSERT_GT(steps, 100U);
  for (const Crash crash : {Crash::kProcessKilled,
                            Crash::kPowerLostAll,
                            Crash::kPowerLostSome,
                            Crash::kPowerLostGarbage}) {
    for (std::uint64_t step = 1; step <= steps; ++step) {
      SCOPED_TRACE(::testing::Message()
                   << "crash " << static_cast<int>(crash) << " at step " << step);
      CreateMap();
      disk_->DieAfter(step);
      Progress progress;
      IgnoreError(RunScript(*store_, progress), "the disk dies");
      Close();
      disk_->Restart(crash, step);
      Reopen();
      ExpectNothingLost(progress);
      if (HasFailure()) {
        return;
      }
      ExpectGoesOn();
      Close();
    }
  }
}

TEST_F(SqliteRecoveryTest, AKillWhileACheckpointIsReplacedLeavesTheOneBeforeItOrBoth) {
  const auto prepare = [this] {
    CreateMap();
    ASSERT_THAT(store_->Append(Entries(1, 12)), IsOk());
    ASSERT_THAT(store_->WriteCheckpoint(ChangesOf(6)), IsOk());
    ASSERT_THAT(store_->WriteCheckpoint(ChangesOf(9)), IsOk());
  };
  CheckpointChanges replacing = ChangesOf(12);
  replacing.since = EventNumber{6};
  prepare();
  const std::string before = Describe(store_->ReadCheckpoint({6}).value());
  const std::uint64_t first = disk_->steps();
  ASSERT_THAT(store_->WriteCheckpoint(replacing), IsOk());
  const std::string after = Describe(store_->ReadCheckpoint({12}).value());
  const std::uint64_t steps = disk_->steps() - first;
  ASSERT_GT(steps, 10U);
  Close();
  for (const Crash crash : {Crash::kProcessKilled, Crash::kPowerLostSome}) {
    for (std::uint64_t step = 1; step <= steps; ++step) {
      SCOPED_TRACE(::testing::Message()
                   << "crash " << static_cast<int>(crash) << " at step " << step);
      prepare();
      disk_->DieAfter(step);
      const bool written = store_->WriteCheckpoint(replacing).ok();
      Close();
      disk_->Restart(crash, step);
      Reopen();
      const std::vector<CheckpointInfo> infos = store_->ListCheckpoints().value();
      ASSERT_FALSE(infos.empty());
      EXPECT_EQ(Describe(store_->ReadCheckpoint({6}).value()), before);
      const std::uint64_t newest = infos.back().last_event.value;
      EXPECT_TRUE(newest == 12 || !written);
      if (newest == 12) {
        EXPECT_EQ(Describe(store_->ReadCheckpoint({12}).value()), after);
      }
      EXPECT_THAT(store_->CheckIntegrity(), IsOk());
      EXPECT_EQ(store_->LastEvent(), EventNumber{12});
      ExpectGoesOn();
      Close();
      if (HasFailure()) {
        return;
      }
    }
  }
}

TEST_F(SqliteRecoveryTest, WhatWasReportedAfterAKillIsThereAfterAPowerCut) {
  const std::uint64_t steps = CountSteps();
  for (std::uint64_t step = 1; step <= steps; ++step) {
    SCOPED_TRACE(::testing::Message() << "killed at step " << step);
    CreateMap();
    disk_->DieAfter(step);
    Progress progress;
    IgnoreError(RunScript(*store_, progress), "the disk dies");
    Close();
    disk_->Restart(Crash::kProcessKilled, step);
    Reopen();
    const EventNumber reported = store_->LastEvent();
    disk_->DieAfter(1);
    Close();
    disk_->Restart(Crash::kPowerLostAll, step);
    Reopen();
    ASSERT_EQ(store_->LastEvent(), reported);
    ExpectNothingLost(progress);
    Close();
  }
}

TEST_F(SqliteRecoveryTest, AfterAFailedCallNothingIsWrittenUntilTheMapIsOpenedAgain) {
  const std::uint64_t steps = CountSteps();
  for (std::uint64_t step = 1; step <= steps; ++step) {
    SCOPED_TRACE(::testing::Message() << "step " << step << " fails");
    CreateMap();
    disk_->FailOnce(step);
    Progress progress;
    const Status status = RunScript(*store_, progress);
    if (!status.ok()) {
      EXPECT_THAT(status, IsStatus(StatusCode::kUnavailable, "open the map again"));
      EXPECT_THAT(store_->Append(Entries(progress.last_event + 1, progress.last_event + 1)),
                  IsStatus(StatusCode::kUnavailable));
    }
    Close();
    // The call that failed may have been a sync: what it should have written is in memory only.
    Reopen();
    ExpectNothingLost(progress);
    const EventNumber reported = store_->LastEvent();
    disk_->DieAfter(1);
    Close();
    disk_->Restart(Crash::kPowerLostAll, step);
    Reopen();
    ASSERT_EQ(store_->LastEvent(), reported);
    ExpectNothingLost(progress);
    ExpectGoesOn();
    Close();
    if (HasFailure()) {
      return;
    }
  }
}

TEST_F(SqliteRecoveryTest, DiskFullIsToldAndNothingAcknowledgedIsLost) {
  for (std::uint64_t free_bytes = 0; free_bytes <= 200'000; free_bytes += 300) {
    SCOPED_TRACE(::testing::Message() << free_bytes << " bytes are free");
    CreateMap();
    disk_->SetFreeBytes(free_bytes);
    Progress progress;
    const Status status = RunScript(*store_, progress);
    if (status.ok()) {
      ASSERT_GT(free_bytes, 10'000U);
      return;
    }
    ASSERT_THAT(status, IsStatus(StatusCode::kResourceExhausted, "the disk is full"));
    progress.asked_event = progress.last_event;  // on this error nothing of it is in the log
    progress.asked_checkpoint = progress.checkpoint;
    ExpectNothingLost(progress);
    disk_->SetFreeBytes(std::nullopt);
    ASSERT_THAT(RunScript(*store_, progress), IsOk());
    ExpectNothingLost(progress);
    Close();
    Reopen();
    ExpectNothingLost(progress);
    ExpectGoesOn();
    Close();
  }
  FAIL() << "the script never had room";
}

// As a quota does: SQLite calls it an I/O error, which would end all writing.
TEST_F(SqliteRecoveryTest, TheSystemsLimitOfFilesIsToldAsAFullDiskAndWritesGoOnAfterwards) {
  class FileSizeLimit {
   public:
    FileSizeLimit() {
      std::signal(SIGXFSZ, SIG_IGN);
      EXPECT_EQ(::getrlimit(RLIMIT_FSIZE, &before_), 0);
    }
    ~FileSizeLimit() { EXPECT_EQ(::setrlimit(RLIMIT_FSIZE, &before_), 0); }
    void Set(rlim_t size) {
      const rlimit limit{.rlim_cur = size, .rlim_max = before_.rlim_max};
      EXPECT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
    }

   private:
    rlimit before_{};
  };
  const TemporaryDirectory disk;
  const auto directory = OpenSqliteDirectory(disk.path()).value();
  std::unique_ptr<MapStore> store = directory->Create("map").value();
  std::uint64_t last = 0;
  FileSizeLimit limit;
  for (rlim_t size = 40'000; size <= 200'000; size += 1'300) {
    SCOPED_TRACE(::testing::Message() << "files of " << size << " bytes");
    limit.Set(size);
    Status status;
    while (status.ok()) {
      status = store->Append(Entries(last + 1, last + 7));
      last += status.ok() ? 7U : 0U;
    }
    ASSERT_THAT(status, IsStatus(StatusCode::kResourceExhausted, "the disk is full"));
    const Status checkpoint = store->WriteCheckpoint(Changes(last, {Record(1, 1, "a")}));
    ASSERT_TRUE(checkpoint.ok() || checkpoint.code() == StatusCode::kResourceExhausted ||
                checkpoint.code() == StatusCode::kFailedPrecondition)
        << checkpoint.ToString();
    EXPECT_EQ(store->LastEvent().value, last);
  }
  limit.Set(RLIM_INFINITY);
  EXPECT_THAT(store->Append(Entries(last + 1, last + 7)), IsOk());
  EXPECT_THAT(store->CheckIntegrity(), IsOk());
}

TEST_F(SqliteRecoveryTest, AMapCanBeOpenedAndReadWhileTheDiskIsFull) {
  CreateMap();
  Progress progress;
  ASSERT_THAT(RunScript(*store_, progress), IsOk());
  disk_->DieAfter(1);
  Close();
  disk_->Restart(Crash::kProcessKilled, 1);
  disk_->SetFreeBytes(0);
  Reopen();
  ExpectNothingLost(progress);
  const std::uint64_t next = progress.last_event + 1;
  std::uint64_t appended = 0;  // free pages may take a few
  Status status;
  while (status.ok() && appended < 100) {
    status = store_->Append(Entries(next + appended, next + appended));
    appended += status.ok() ? 1U : 0U;
  }
  EXPECT_THAT(status, IsStatus(StatusCode::kResourceExhausted, "the disk is full"));
  disk_->SetFreeBytes(std::nullopt);
  ExpectGoesOn();
}

}  // namespace
}  // namespace loci
