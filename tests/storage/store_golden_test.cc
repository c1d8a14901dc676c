// SPDX-License-Identifier: Apache-2.0
// Map files of every released schema open, and hold what they held.
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include <gtest/gtest.h>
#include <sqlite3.h>

#include "core/engine/event.h"
#include "storage/sqlite/sqlite_store.h"
#include "storage/store.h"
#include "tests/storage/store_content.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

// Makes a file of the statements in tests/golden.
void MakeFile(const std::string& golden, const std::filesystem::path& file) {
  std::ifstream in(std::filesystem::path(LOCI_GOLDEN_DIR) / golden);
  const std::string sql{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  ASSERT_FALSE(sql.empty()) << golden;
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &handle), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
      << sqlite3_errmsg(handle);
  sqlite3_close(handle);
}

TEST(StoreGoldenTest, AFileOfSchema1HoldsWhatItHeld) {
  const TemporaryDirectory temporary(TemporaryDirectory::Medium::kMemory);
  MakeFile("store_schema_1.sql", temporary.path() / "old.loci");
  const auto directory = OpenSqliteDirectory(temporary.path()).value();
  StatusOr<std::unique_ptr<MapStore>> store = directory->Open("old");
  ASSERT_THAT(store, IsOk());
  EXPECT_THAT((*store)->CheckIntegrity(), IsOk());
  EXPECT_EQ((*store)->LastEvent(), EventNumber{4});
  EXPECT_EQ(Describe((*store)->ReadCheckpoint({2}).value()), "2 00ff [1 7 hi] [1 8 old]");
  EXPECT_EQ(Describe((*store)->ReadCheckpoint({3}).value()),
            "3 01ff [1 7 hi] [1 8 new] [100 18446744073709551615 " + std::string(200, 'a') + "]");
  EXPECT_THAT((*store)->ReadLog({1},
                                [](const LogEntry& entry) {
                                  const StatusOr<Event> event = DecodeEvent(entry.bytes);
                                  EXPECT_THAT(event, IsOk());
                                  EXPECT_EQ(std::get<CloseSessionEvent>(*event).session.value,
                                            entry.number.value);
                                  return Status();
                                }),
              IsOk());
  EXPECT_THAT((*store)->Append(Entries(5, 6)), IsOk());
  EXPECT_THAT((*store)->WriteCheckpoint(Changes(6, {Record(1, 8, "newer")})), IsOk());
  EXPECT_THAT((*store)->CheckIntegrity(), IsOk());
}

}  // namespace
}  // namespace loci
