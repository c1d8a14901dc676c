// SPDX-License-Identifier: Apache-2.0
// Map files that are damaged, cut off, of another program or of another time.
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "core/base/random.h"
#include "storage/sqlite/sqlite_store.h"
#include "storage/store.h"
#include "tests/storage/store_content.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

using ::testing::AnyOf;
using ::testing::ElementsAre;

std::string ReadAll(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void WriteAll(const std::filesystem::path& file, const std::string& content) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << content;
}

class SqliteDamageTest : public ::testing::Test {
 protected:
  SqliteDamageTest() {
    directory_ = OpenSqliteDirectory(temporary_.path()).value();
    std::unique_ptr<MapStore> store = directory_->Create("map").value();
    Fill(*store);
    content_ = DescribeStore(*store).value();
    // As after a kill: with a write-ahead log.
    wal_bytes_ = ReadAll(wal_);
    EXPECT_GT(wal_bytes_.size(), 10'000U);
    bytes_before_closing_ = ReadAll(file_);
    store.reset();
    bytes_ = ReadAll(file_);
    EXPECT_FALSE(std::filesystem::exists(wal_));
  }

  static void Fill(MapStore& store) {
    for (std::uint64_t number = 1; number <= 30; ++number) {
      ASSERT_THAT(store.Append(Entries(number, number)), IsOk());
    }
    ASSERT_THAT(store.WriteCheckpoint(Changes(
                    10, {Record(1, 1, EventBytes(1)), Record(1, 2, std::string(9000, 'x'))})),
                IsOk());
    ASSERT_THAT(
        store.WriteCheckpoint(Changes(30, {Record(1, 1, EventBytes(2)), Record(100, 1, "h")})),
        IsOk());
    ASSERT_THAT(store.Append(Entries(31, 40)), IsOk());
  }

  // Opens, checks and reads the map; the first error, or its content.
  StatusOr<std::string> ReadMap() {
    LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<MapStore> store, directory_->Open("map"));
    LOCI_RETURN_IF_ERROR(store->CheckIntegrity());
    return DescribeStore(*store);
  }
  void Put(const std::string& bytes) {
    std::filesystem::remove(wal_);
    std::filesystem::remove(temporary_.path() / "map.loci-shm");
    WriteAll(file_, bytes);
  }
  void PutWithWal(const std::string& wal_bytes) {
    Put(bytes_before_closing_);
    WriteAll(wal_, wal_bytes);
  }
  // Runs SQL on the file, as another program may.
  void Execute(const std::string& sql) {
    sqlite3* handle = nullptr;
    ASSERT_EQ(sqlite3_open(file_.c_str(), &handle), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
        << sqlite3_errmsg(handle);
    sqlite3_close(handle);
  }

  TemporaryDirectory temporary_{TemporaryDirectory::Medium::kMemory};
  const std::filesystem::path file_ = temporary_.path() / "map.loci";
  const std::filesystem::path wal_ = temporary_.path() / "map.loci-wal";
  std::unique_ptr<StoreDirectory> directory_;
  std::string content_;
  std::string bytes_;  // of the file, closed
  std::string bytes_before_closing_;
  std::string wal_bytes_;
};

TEST_F(SqliteDamageTest, AFlippedBitIsFoundOrChangesNothing) {
  RandomSequence random(1);
  int found = 0;
  // Every byte of the file's header, many of each page's, a sample of the others.
  for (std::size_t offset = 0; offset < bytes_.size();
       offset += offset < 100 ? 1 : 1 + random.NextBits() % (offset % 4096 < 100 ? 8 : 300)) {
    std::string damaged = bytes_;
    damaged[offset] = static_cast<char>(damaged[offset] ^ (1 << (random.NextBits() % 8)));
    Put(damaged);
    const StatusOr<std::string> read = ReadMap();
    if (read.ok()) {
      ASSERT_EQ(*read, content_) << "byte " << offset;
    } else {
      ++found;
      ASSERT_THAT(read,
                  AnyOf(IsStatus(StatusCode::kDataLoss, "map.loci"),
                        IsStatus(StatusCode::kFailedPrecondition, "newer")))
          << "byte " << offset;
    }
  }
  EXPECT_GT(found, 60);
}

TEST_F(SqliteDamageTest, TruncationAtAnyLengthIsFound) {
  for (std::size_t size = 0; size < bytes_.size(); size += size < 200 ? 7 : 997) {
    Put(bytes_.substr(0, size));
    EXPECT_THAT(ReadMap(), IsStatus(StatusCode::kDataLoss, "map.loci")) << size << " bytes";
  }
}

TEST_F(SqliteDamageTest, AFlippedBitInTheWriteAheadLogNeverDropsAnEventWithoutAWord) {
  PutWithWal(wal_bytes_);
  ASSERT_EQ(ReadMap().value(), content_);
  RandomSequence random(2);
  int found = 0;
  for (std::size_t offset = 0; offset < wal_bytes_.size();
       offset += offset < 200 ? 1 : 1 + random.NextBits() % 1000) {
    std::string damaged = wal_bytes_;
    damaged[offset] = static_cast<char>(damaged[offset] ^ (1 << (random.NextBits() % 8)));
    PutWithWal(damaged);
    const StatusOr<std::string> read = ReadMap();
    if (!read.ok()) {
      ++found;
      ASSERT_THAT(read, IsStatus(StatusCode::kDataLoss, "map.loci")) << "byte " << offset;
    } else if (*read != content_) {
      // The limit: the last transaction, events 31 to 40, looks as if it had been cut off.
      EXPECT_EQ(read->substr(0, 8), "last 30\n") << "byte " << offset;
    }
  }
  EXPECT_GT(found, 80);
}

TEST_F(SqliteDamageTest, ACutWriteAheadLogIsRecoveredUpToItsLastWholeTransaction) {
  for (std::size_t size = 0; size <= wal_bytes_.size(); size += 3777) {
    PutWithWal(wal_bytes_.substr(0, size));
    ASSERT_THAT(ReadMap(), IsOk()) << size << " bytes";
  }
}

TEST_F(SqliteDamageTest, WhatIsNoMapFileIsRefused) {
  for (const std::string& bytes : {std::string(),
                                   std::string("x"),
                                   std::string(10'000, 'x'),
                                   std::string(4096, '\0'),
                                   bytes_.substr(1)}) {
    Put(bytes);
    EXPECT_THAT(directory_->Open("map"),
                IsStatus(StatusCode::kDataLoss, "restore the map from a backup, or delete it"));
  }
  std::filesystem::remove(file_);
  Execute("CREATE TABLE other (x)");  // a database, but not of ours
  EXPECT_THAT(directory_->Open("map"), IsStatus(StatusCode::kDataLoss, "not a map file"));
}

TEST_F(SqliteDamageTest, ANewerSchemaIsRefusedAndLeftAlone) {
  Execute("PRAGMA user_version = 7");
  const std::string before = ReadAll(file_);
  EXPECT_THAT(directory_->Open("map"),
              IsStatus(StatusCode::kFailedPrecondition, "schema version 7 is newer"));
  EXPECT_EQ(ReadAll(file_), before);
}

TEST_F(SqliteDamageTest, AnotherSchemaThanItsVersionSaysIsRefused) {
  Execute("DROP INDEX record_by_end");
  EXPECT_THAT(directory_->Open("map"), IsStatus(StatusCode::kDataLoss, "schema"));
}

TEST_F(SqliteDamageTest, DamagedMapsAreListedAndCanBeDeletedWhileOthersAreServed) {
  Put("rubbish");
  ASSERT_THAT(directory_->Create("other"), IsOk());
  EXPECT_THAT(directory_->List().value(), ElementsAre("map", "other"));
  EXPECT_THAT(directory_->Open("map"), IsStatus(StatusCode::kDataLoss));
  EXPECT_THAT(directory_->Open("other"), IsOk());
  EXPECT_THAT(directory_->Delete("map"), IsOk());
  EXPECT_THAT(directory_->List().value(), ElementsAre("other"));
}

struct RowDamage {
  std::string sql;
  std::string message;
};

TEST_F(SqliteDamageTest, DamageIsNamedByTableAndNumber) {
  const std::vector<RowDamage> cases = {
      {"UPDATE log SET bytes = x'00' WHERE number = 12", "table log, event 12: the checksum"},
      {"UPDATE log SET number = 50 WHERE number = 12", "table log, event 50: the checksum"},
      {"UPDATE log SET end_bytes = 0 WHERE number = 12", "table log, event 12: the checksum"},
      {"DELETE FROM log WHERE number = 12", "event 12 is missing"},
      {"DELETE FROM log WHERE number = 1", "event 1 is missing"},
      {"DELETE FROM log WHERE number >= 30", "log ends with event 29"},
      {"UPDATE log SET bytes = (SELECT bytes FROM log WHERE number = 13) WHERE number = 12",
       "table log, event 12: the checksum"},
      {"UPDATE checkpoint SET state_digest = 'x' WHERE last_event = 10",
       "table checkpoint, event 10: the checksum"},
      {"DELETE FROM record WHERE kind = 100", "table checkpoint, event 30: has 2 records"},
      {"UPDATE record SET valid_until = 20 WHERE kind = 1 AND id = 2", "event 30: has 2 records"},
      {"UPDATE record SET id = 7 WHERE kind = 1 AND id = 2", "kind 1, id 7, blob 2: checksum"},
      {"UPDATE record SET size_bytes = 2 WHERE kind = 100", "kind 100, id 1, blob 4: checksum"},
      {"UPDATE blob SET bytes = x'00' WHERE id = 1", "kind 1, id 1, blob 1: checksum"},
      {"DELETE FROM blob WHERE id = 1", "kind 1, id 1, blob 1: its bytes are missing"},
      {"INSERT INTO blob VALUES (77, x'00')", "table blob, id 77: no record has it"},
      {"INSERT INTO log_trim VALUES (1, 20, 5, 5)", "table log_trim: the checksum"},
  };
  for (const RowDamage& damage : cases) {
    Put(bytes_);
    Execute(damage.sql);
    const StatusOr<std::string> read = ReadMap();
    EXPECT_THAT(read, IsStatus(StatusCode::kDataLoss, damage.message)) << damage.sql;
    EXPECT_THAT(read, IsStatus(StatusCode::kDataLoss, "map.loci is damaged")) << damage.sql;
  }
}

TEST_F(SqliteDamageTest, ADamagedNewestCheckpointIsReplacedByOneThatCountsFromThatBeforeIt) {
  const std::vector<std::string> damages = {
      "UPDATE blob SET bytes = x'00' WHERE id = 3",
      "UPDATE record SET size_bytes = 2 WHERE kind = 100",
      "DELETE FROM record WHERE kind = 100",
      "DELETE FROM blob WHERE id = 4",
      "UPDATE record SET valid_until = 20 WHERE kind = 1 AND id = 2",
      "UPDATE record SET checksum = 1 WHERE blob_id = 3",
  };
  for (const std::uint64_t event : {30U, 35U}) {
    for (const std::string& damage : damages) {
      SCOPED_TRACE(damage);
      Put(bytes_);
      Execute(damage);
      const std::unique_ptr<MapStore> store = directory_->Open("map").value();
      ASSERT_THAT(store->ReadCheckpoint({30}), IsStatus(StatusCode::kDataLoss));
      ASSERT_THAT(store->ReadCheckpoint({10}), IsOk());
      ASSERT_THAT(store->WriteCheckpoint(Changes(
                      event, {Record(1, 1, "healed"), Record(100, 1, "h2")}, EventNumber{10})),
                  IsOk());
      const StatusOr<Checkpoint> healed = store->ReadCheckpoint({event});
      ASSERT_THAT(healed, IsOk());
      EXPECT_EQ(healed->records.size(), 3U);
      EXPECT_EQ(store->ListCheckpoints()->size(), 2U);
      ASSERT_THAT(store->WriteCheckpoint(Changes(37, {Record(1, 2, "goes on")})), IsOk());
      EXPECT_THAT(store->ReadCheckpoint({37}), IsOk());
    }
  }
}

TEST_F(SqliteDamageTest, HalfMadeAndHalfDeletedMapsAreGoneAfterTheNextStart) {
  directory_.reset();
  WriteAll(temporary_.path() / "half.loci.new", bytes_.substr(0, 5000));
  WriteAll(temporary_.path() / "half.loci.new-wal", wal_bytes_);
  std::filesystem::rename(file_, temporary_.path() / "map.loci.deleted");
  WriteAll(wal_, wal_bytes_);
  directory_ = OpenSqliteDirectory(temporary_.path()).value();
  EXPECT_THAT(directory_->List().value(), ElementsAre());
  EXPECT_FALSE(std::filesystem::exists(wal_));
  EXPECT_EQ(directory_->Create("map").value()->LastEvent(), EventNumber{0});
}

TEST_F(SqliteDamageTest, ADirectoryThatCannotBeMadeIsRefused) {
  WriteAll(temporary_.path() / "file", "x");
  EXPECT_THAT(OpenSqliteDirectory(temporary_.path() / "file" / "data"),
              IsStatus(StatusCode::kUnavailable, "file/data"));
}

}  // namespace
}  // namespace loci
