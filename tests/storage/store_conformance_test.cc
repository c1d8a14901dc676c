// SPDX-License-Identifier: Apache-2.0
// What every driver of the store must do.
#include <algorithm>
#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "storage/sqlite/sqlite_store.h"
#include "storage/store.h"
#include "tests/storage/store_content.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

struct Driver {
  std::string name;
  std::function<StatusOr<std::unique_ptr<StoreDirectory>>(const std::filesystem::path&)> open;
};

void PrintTo(const Driver& driver, std::ostream* out) {
  *out << driver.name;
}

class StoreTest : public ::testing::TestWithParam<Driver> {
 protected:
  StoreTest() { OpenDirectory(); }

  void OpenDirectory() {
    StatusOr<std::unique_ptr<StoreDirectory>> opened = GetParam().open(temporary_.path());
    ASSERT_THAT(opened, IsOk());
    directory_ = std::move(opened).value();
  }
  std::unique_ptr<MapStore> Create(const std::string& map = "map") {
    StatusOr<std::unique_ptr<MapStore>> store = directory_->Create(map);
    EXPECT_THAT(store, IsOk());
    return std::move(store).value();
  }
  std::unique_ptr<MapStore> Open(const std::string& map = "map") {
    StatusOr<std::unique_ptr<MapStore>> store = directory_->Open(map);
    EXPECT_THAT(store, IsOk());
    return std::move(store).value();
  }
  static std::string ReadOne(const MapStore& store, std::uint64_t last_event) {
    const StatusOr<Checkpoint> checkpoint = store.ReadCheckpoint({last_event});
    return checkpoint.ok() ? Describe(*checkpoint) : checkpoint.status().ToString();
  }
  static std::vector<std::uint64_t> CheckpointNumbers(const MapStore& store) {
    std::vector<std::uint64_t> numbers;
    const std::vector<CheckpointInfo> infos = store.ListCheckpoints().value();
    for (const CheckpointInfo& info : infos) {
      numbers.push_back(info.last_event.value);
    }
    return numbers;
  }

  TemporaryDirectory temporary_{TemporaryDirectory::Medium::kMemory};
  std::unique_ptr<StoreDirectory> directory_;
};

TEST_P(StoreTest, MapsAreMadeListedOpenedAndDeleted) {
  EXPECT_THAT(directory_->List().value(), IsEmpty());
  Create("b");
  Create("a_-9");
  EXPECT_THAT(directory_->List().value(), ElementsAre("a_-9", "b"));
  EXPECT_THAT(directory_->Create("b"), IsStatus(StatusCode::kAlreadyExists, "\"b\""));
  EXPECT_THAT(directory_->Open("c"), IsStatus(StatusCode::kNotFound, "\"c\""));
  EXPECT_THAT(directory_->Delete("c"), IsStatus(StatusCode::kNotFound, "\"c\""));
  EXPECT_THAT(directory_->Delete("b"), IsOk());
  EXPECT_THAT(directory_->List().value(), ElementsAre("a_-9"));
  EXPECT_THAT(directory_->Open("b"), IsStatus(StatusCode::kNotFound));
}

TEST_P(StoreTest, NamesThatAreNoMapNamesAreRefused) {
  for (const std::string& name : {std::string(),
                                  std::string("../x"),
                                  std::string("a/b"),
                                  std::string("A"),
                                  std::string(65, 'a'),
                                  std::string("a\0b", 3)}) {
    EXPECT_THAT(directory_->Create(name), IsStatus(StatusCode::kInvalidArgument, "must match"));
    EXPECT_THAT(directory_->Open(name), IsStatus(StatusCode::kInvalidArgument));
    EXPECT_THAT(directory_->Delete(name), IsStatus(StatusCode::kInvalidArgument));
  }
}

TEST_P(StoreTest, AMapIsOpenOnceAtMost) {
  std::unique_ptr<MapStore> store = Create();
  EXPECT_THAT(directory_->Open("map"), IsStatus(StatusCode::kFailedPrecondition, "open"));
  EXPECT_THAT(directory_->Delete("map"), IsStatus(StatusCode::kFailedPrecondition, "open"));
  store.reset();
  store = Open();
}

TEST_P(StoreTest, AMapMadeAgainIsEmpty) {
  ASSERT_THAT(Create()->Append(Entries(1, 5)), IsOk());
  ASSERT_THAT(directory_->Delete("map"), IsOk());
  EXPECT_EQ(Create()->LastEvent(), EventNumber{0});
}

TEST_P(StoreTest, ASecondServerOnTheDirectoryIsRefused) {
  EXPECT_THAT(GetParam().open(temporary_.path()),
              IsStatus(StatusCode::kFailedPrecondition, "another server"));
  directory_.reset();
  OpenDirectory();
}

TEST_P(StoreTest, AnEmptyStoreReadsAsEmpty) {
  const std::unique_ptr<MapStore> store = Create();
  EXPECT_EQ(DescribeStore(*store).value(), "last 0\n");
  EXPECT_THAT(store->ReadCheckpoint({0}), IsStatus(StatusCode::kNotFound));
  EXPECT_THAT(store->CheckIntegrity(), IsOk());
  EXPECT_THAT(store->TrimLog({0}), IsOk());
}

TEST_P(StoreTest, TheLogGivesBackWhatWasAppended) {
  std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 1)), IsOk());
  ASSERT_THAT(store->Append(Entries(2, 40)), IsOk());
  ASSERT_THAT(store->Append({}), IsOk());
  EXPECT_EQ(store->LastEvent(), EventNumber{40});
  const std::string content = DescribeStore(*store).value();
  store.reset();
  store = Open();
  EXPECT_EQ(store->LastEvent(), EventNumber{40});
  EXPECT_EQ(DescribeStore(*store).value(), content);

  std::uint64_t expected = 31;
  ASSERT_THAT(store->ReadLog({30},
                             [&](const LogEntry& entry) {
                               EXPECT_EQ(entry.number, EventNumber{expected});
                               EXPECT_EQ(entry.bytes, EventBytes(expected));
                               ++expected;
                               return Status();
                             }),
              IsOk());
  EXPECT_EQ(expected, 41U);
}

TEST_P(StoreTest, EntriesMayBeEmptyOrLarge) {
  const std::unique_ptr<MapStore> store = Create();
  const std::vector<LogEntry> entries = {{.number = {1}, .bytes = ""},
                                         {.number = {2}, .bytes = std::string(3 << 20, 'x')},
                                         {.number = {3}, .bytes = std::string("a\0b", 3)}};
  ASSERT_THAT(store->Append(entries), IsOk());
  std::vector<std::string> read;
  ASSERT_THAT(store->ReadLog({0},
                             [&](const LogEntry& entry) {
                               read.push_back(entry.bytes);
                               return Status();
                             }),
              IsOk());
  EXPECT_THAT(read, ElementsAre(entries[0].bytes, entries[1].bytes, entries[2].bytes));
}

TEST_P(StoreTest, AnEntryAboveTheLimitIsRefused) {
  const std::unique_ptr<MapStore> store = Create();
  const std::vector<LogEntry> entries = {
      {.number = {1}, .bytes = std::string(kEntrySizeMax + 1, 'x')}};
  EXPECT_THAT(store->Append(entries), IsStatus(StatusCode::kInvalidArgument, "must be at most"));
  EXPECT_EQ(store->LastEvent(), EventNumber{0});
}

TEST_P(StoreTest, ReadingTheLogStopsAtTheVisitorsError) {
  const std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 5)), IsOk());
  int visited = 0;
  EXPECT_THAT(store->ReadLog({0},
                             [&](const LogEntry&) {
                               ++visited;
                               return CancelledError("enough");
                             }),
              IsStatus(StatusCode::kCancelled, "enough"));
  EXPECT_EQ(visited, 1);
}

TEST_P(StoreTest, GapsAreRefusedAndNothingOfTheirGroupIsKept) {
  const std::unique_ptr<MapStore> store = Create();
  EXPECT_THAT(store->Append(Entries(2, 3)),
              IsStatus(StatusCode::kFailedPrecondition, "event number 2, must be 1"));
  ASSERT_THAT(store->Append(Entries(1, 3)), IsOk());
  std::vector<LogEntry> gap = Entries(4, 6);
  gap.erase(gap.begin() + 1);
  EXPECT_THAT(store->Append(gap),
              IsStatus(StatusCode::kFailedPrecondition, "event number 6, must be 5"));
  EXPECT_THAT(store->Append(Entries(3, 4)), IsStatus(StatusCode::kFailedPrecondition));
  EXPECT_EQ(store->LastEvent(), EventNumber{3});
  EXPECT_THAT(store->Append(Entries(4, 6)), IsOk());
}

TEST_P(StoreTest, CheckpointsGiveBackTheirStateInOrderOfKindAndId) {
  std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 10)), IsOk());
  ASSERT_THAT(
      store->WriteCheckpoint(Changes(
          4, {Record(2, 0, "b"), Record(1, 7, "a"), Record(1, 3, ""), Record(150, 1, "h")})),
      IsOk());
  CheckpointChanges changes = Changes(9, {Record(1, 7, "a2"), Record(1, 8, "new")});
  changes.removed = {{2, 0}, {5, 5}};  // there is no (5, 5)
  ASSERT_THAT(store->WriteCheckpoint(changes), IsOk());
  for (int round = 0; round < 2; ++round) {
    EXPECT_THAT(CheckpointNumbers(*store), ElementsAre(4, 9));
    EXPECT_EQ(ReadOne(*store, 4), "4 digest-4 [1 3 ] [1 7 a] [2 0 b] [150 1 h]");
    EXPECT_EQ(ReadOne(*store, 9), "9 digest-9 [1 3 ] [1 7 a2] [1 8 new] [150 1 h]");
    EXPECT_THAT(store->ReadCheckpoint({5}), IsStatus(StatusCode::kNotFound, "5"));
    EXPECT_THAT(store->CheckIntegrity(), IsOk());
    store.reset();
    store = Open();
  }
}

TEST_P(StoreTest, TheTwoNewestCheckpointsAreKept) {
  const std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 10)), IsOk());
  for (std::uint64_t number = 1; number <= 5; ++number) {
    CheckpointChanges changes = Changes(
        number, {Record(1, 0, "changes " + std::to_string(number)), Record(2, number, "new")});
    if (number > 1) {
      changes.removed = {{2, number - 1}};
    }
    ASSERT_THAT(store->WriteCheckpoint(changes), IsOk());
  }
  EXPECT_THAT(CheckpointNumbers(*store), ElementsAre(4, 5));
  EXPECT_EQ(ReadOne(*store, 4), "4 digest-4 [1 0 changes 4] [2 4 new]");
  EXPECT_EQ(ReadOne(*store, 5), "5 digest-5 [1 0 changes 5] [2 5 new]");
  EXPECT_THAT(store->ReadCheckpoint({3}), IsStatus(StatusCode::kNotFound));
  EXPECT_THAT(store->CheckIntegrity(), IsOk());
}

TEST_P(StoreTest, ACheckpointReplacesThoseAfterTheOneThatItCountsFrom) {
  std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 10)), IsOk());
  ASSERT_THAT(store->WriteCheckpoint(Changes(4, {Record(1, 0, "a"), Record(1, 1, "b")})), IsOk());
  CheckpointChanges replaced = Changes(8, {Record(1, 0, "wrong"), Record(1, 2, "wrong")});
  replaced.removed = {{1, 1}};
  ASSERT_THAT(store->WriteCheckpoint(replaced), IsOk());
  // Of the same event, and then of an earlier one.
  ASSERT_THAT(store->WriteCheckpoint(Changes(8, {Record(1, 3, "c")}, EventNumber{4})), IsOk());
  EXPECT_THAT(CheckpointNumbers(*store), ElementsAre(4, 8));
  EXPECT_EQ(ReadOne(*store, 8), "8 digest-8 [1 0 a] [1 1 b] [1 3 c]");
  ASSERT_THAT(store->WriteCheckpoint(Changes(6, {Record(1, 0, "d")}, EventNumber{4})), IsOk());
  for (int round = 0; round < 2; ++round) {
    EXPECT_THAT(CheckpointNumbers(*store), ElementsAre(4, 6));
    EXPECT_EQ(ReadOne(*store, 4), "4 digest-4 [1 0 a] [1 1 b]");
    EXPECT_EQ(ReadOne(*store, 6), "6 digest-6 [1 0 d] [1 1 b]");
    EXPECT_THAT(store->CheckIntegrity(), IsOk());
    store.reset();
    store = Open();
  }
  ASSERT_THAT(store->WriteCheckpoint(Changes(9, {Record(1, 7, "all")}, EventNumber{0})), IsOk());
  EXPECT_THAT(CheckpointNumbers(*store), ElementsAre(9));
  EXPECT_EQ(ReadOne(*store, 9), "9 digest-9 [1 7 all]");
  EXPECT_THAT(store->CheckIntegrity(), IsOk());
}

TEST_P(StoreTest, ARecordMayBeWrittenAgainAfterItWasRemoved) {
  const std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 10)), IsOk());
  ASSERT_THAT(store->WriteCheckpoint(Changes(1, {Record(1, 1, "a")})), IsOk());
  CheckpointChanges removal = Changes(2, {});
  removal.removed = {{1, 1}};
  ASSERT_THAT(store->WriteCheckpoint(removal), IsOk());
  EXPECT_EQ(ReadOne(*store, 2), "2 digest-2");
  ASSERT_THAT(store->WriteCheckpoint(Changes(3, {Record(1, 1, "again")})), IsOk());
  EXPECT_EQ(ReadOne(*store, 2), "2 digest-2");
  EXPECT_EQ(ReadOne(*store, 3), "3 digest-3 [1 1 again]");
}

TEST_P(StoreTest, NamesAndSizesOfRecordsUseTheirWholeRange) {
  const std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 1)), IsOk());
  std::string large;
  for (std::uint64_t i = 1; large.size() < (3U << 20U); ++i) {
    large += EventBytes(i);
  }
  const std::vector<StateRecord> records = {Record(0xFFFFFFFFU, ~0ULL, large),
                                            Record(0, 0, std::string(1 << 20, '\0')),
                                            Record(0xFFFFFFFFU, 0, "x")};
  ASSERT_THAT(store->WriteCheckpoint(Changes(1, records)), IsOk());
  const StatusOr<Checkpoint> checkpoint = store->ReadCheckpoint({1});
  ASSERT_THAT(checkpoint, IsOk());
  ASSERT_EQ(checkpoint->records.size(), 3U);
  for (const StateRecord& wanted : records) {
    EXPECT_TRUE(std::any_of(
        checkpoint->records.begin(), checkpoint->records.end(), [&](const StateRecord& record) {
          return record.kind == wanted.kind && record.id == wanted.id &&
                 record.bytes == wanted.bytes;
        }));
  }
  EXPECT_THAT(store->CheckIntegrity(), IsOk());
}

TEST_P(StoreTest, CheckpointsThatCannotBeAreRefusedAndChangeNothing) {
  const std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 10)), IsOk());
  ASSERT_THAT(store->WriteCheckpoint(Changes(5, {Record(1, 1, "a")})), IsOk());
  const std::string content = DescribeStore(*store).value();
  EXPECT_THAT(store->WriteCheckpoint(Changes(5, {})),
              IsStatus(StatusCode::kFailedPrecondition, "must be above 5 and at most 10"));
  EXPECT_THAT(store->WriteCheckpoint(Changes(11, {})), IsStatus(StatusCode::kFailedPrecondition));
  EXPECT_THAT(store->WriteCheckpoint(Changes(7, {}, EventNumber{4})),
              IsStatus(StatusCode::kFailedPrecondition, "event 4, which is not kept"));
  EXPECT_THAT(store->WriteCheckpoint(Changes(6, {Record(3, 4, "a"), Record(3, 4, "b")})),
              IsStatus(StatusCode::kInvalidArgument, "kind 3, id 4: is given twice"));
  EXPECT_EQ(DescribeStore(*store).value(), content);
}

TEST_P(StoreTest, TheLogIsTrimmedUpToTheOldestCheckpointOnly) {
  std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 3000)), IsOk());
  EXPECT_THAT(store->TrimLog({1}), IsStatus(StatusCode::kFailedPrecondition, "at most 0"));
  ASSERT_THAT(store->WriteCheckpoint(Changes(2500, {Record(1, 1, "a")})), IsOk());
  ASSERT_THAT(store->WriteCheckpoint(Changes(3000, {Record(1, 1, "b")})), IsOk());
  EXPECT_THAT(store->TrimLog({2501}), IsStatus(StatusCode::kFailedPrecondition, "at most 2500"));
  ASSERT_THAT(store->TrimLog({2500}), IsOk());
  ASSERT_THAT(store->TrimLog({100}), IsOk());  // gone already
  for (int round = 0; round < 2; ++round) {
    EXPECT_THAT(DescribeStore(*store, 2499), IsStatus(StatusCode::kOutOfRange, "up to 2500"));
    EXPECT_THAT(DescribeStore(*store, 2500), IsOk());
    EXPECT_THAT(store->CheckIntegrity(), IsOk());
    store.reset();
    store = Open();
  }
  EXPECT_THAT(store->Append(Entries(3001, 3002)), IsOk());
  // Nothing would be left to recover from while such a checkpoint is written.
  EXPECT_THAT(store->WriteCheckpoint(Changes(3001, {Record(1, 1, "c")}, EventNumber{0})),
              IsStatus(StatusCode::kFailedPrecondition, "the log begins after event 2500"));
  EXPECT_THAT(CheckpointNumbers(*store), ElementsAre(2500, 3000));
  EXPECT_THAT(store->Append(Entries(3003, 3003)), IsOk());
}

TEST_P(StoreTest, TheLastNumberOutlivesItsEntry) {
  std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 7)), IsOk());
  ASSERT_THAT(store->WriteCheckpoint(Changes(7, {})), IsOk());
  ASSERT_THAT(store->TrimLog({7}), IsOk());
  EXPECT_EQ(store->MeasureBytes().value().log, 0U);
  store.reset();
  store = Open();
  EXPECT_EQ(store->LastEvent(), EventNumber{7});
  EXPECT_THAT(store->Append(Entries(8, 9)), IsOk());
  EXPECT_THAT(store->CheckIntegrity(), IsOk());
}

TEST_P(StoreTest, BytesAreMeasuredApartByWhatTheyAreFor) {
  const std::unique_ptr<MapStore> store = Create();
  ASSERT_THAT(store->Append(Entries(1, 100)), IsOk());
  std::uint64_t log = 0;
  for (const LogEntry& entry : Entries(1, 100)) {
    log += entry.bytes.size();
  }
  const std::string bytes = EventBytes(1) + EventBytes(2);  // random: not compressed
  ASSERT_THAT(store->WriteCheckpoint(
                  Changes(100, {Record(1, 1, bytes), Record(99, 1, bytes), Record(100, 1, bytes)})),
              IsOk());
  const StoredBytes measured = store->MeasureBytes().value();
  EXPECT_EQ(measured.log, log);
  EXPECT_EQ(measured.map, 2 * bytes.size());
  EXPECT_EQ(measured.history, bytes.size());
  EXPECT_GT(measured.total, measured.log + measured.map + measured.history);
}

TEST_P(StoreTest, AppendsCheckpointsTrimsAndReadsGoOnTogether) {
  const std::unique_ptr<MapStore> store = Create();
  constexpr std::uint64_t kEvents = 300;
  std::atomic<bool> appended = false;
  std::thread appender([&] {
    for (std::uint64_t number = 1; number <= kEvents; number += 3) {
      EXPECT_THAT(store->Append(Entries(number, number + 2)), IsOk());
    }
    appended = true;
  });
  std::thread checkpointer([&] {
    std::uint64_t written = 0;
    while (!appended) {
      const std::uint64_t last = store->LastEvent().value;
      if (last > written) {
        std::vector<StateRecord> records;
        for (std::uint64_t id = 0; id < 20; ++id) {
          records.push_back(Record(1, id, std::to_string(last) + std::string(5000, 'x')));
        }
        EXPECT_THAT(store->WriteCheckpoint(Changes(last, records)), IsOk());
        const std::vector<CheckpointInfo> infos = store->ListCheckpoints().value();
        EXPECT_THAT(store->TrimLog(infos.front().last_event), IsOk());
        written = last;
      }
    }
  });
  std::thread reader([&] {
    while (!appended) {
      const std::vector<CheckpointInfo> infos = store->ListCheckpoints().value();
      if (!infos.empty()) {
        const StatusOr<Checkpoint> checkpoint = store->ReadCheckpoint(infos.back().last_event);
        if (checkpoint.ok()) {  // else it was removed meanwhile
          EXPECT_EQ(checkpoint->records.size(), 20U);
        } else {
          EXPECT_THAT(checkpoint, IsStatus(StatusCode::kNotFound));
        }
      }
      EXPECT_THAT(store->MeasureBytes(), IsOk());
    }
  });
  appender.join();
  checkpointer.join();
  reader.join();
  EXPECT_EQ(store->LastEvent(), EventNumber{kEvents});
  EXPECT_THAT(store->CheckIntegrity(), IsOk());
}

INSTANTIATE_TEST_SUITE_P(Drivers,
                         StoreTest,
                         ::testing::Values(Driver{"Sqlite",
                                                  [](const std::filesystem::path& path) {
                                                    return OpenSqliteDirectory(
                                                        path,
                                                        {.vfs = "", .stage_size_bytes = 20000});
                                                  }}),
                         [](const auto& driver) { return driver.param.name; });

}  // namespace
}  // namespace loci
