// SPDX-License-Identifier: Apache-2.0
// The store of one map in one SQLite file.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "storage/record_codec.h"
#include "storage/sqlite/checkpoint_table.h"
#include "storage/sqlite/connection.h"
#include "storage/sqlite/log_table.h"
#include "storage/sqlite/reader_pool.h"
#include "storage/sqlite/sqlite_store.h"
#include "storage/sqlite/writer_turn.h"
#include "storage/store.h"

namespace loci {

// One connection writes, and its transactions take turns; each reader has a connection of its own.
class SqliteMapStore final : public MapStore {
 public:
  // Makes a file with an empty store; nobody has it open afterwards.
  static Status Create(const std::filesystem::path& file, const SqliteStoreOptions& options);

  // Recovers a file, and removes what a crash left of an unfinished checkpoint. `registration` is
  // destroyed when the file is closed. Errors: as StoreDirectory::Open.
  static StatusOr<std::unique_ptr<SqliteMapStore>> Open(const std::filesystem::path& file,
                                                        const SqliteStoreOptions& options,
                                                        std::shared_ptr<void> registration);

  SqliteMapStore(const SqliteMapStore&) = delete;
  SqliteMapStore& operator=(const SqliteMapStore&) = delete;

  Status Append(std::span<const LogEntry> entries) override;
  EventNumber LastEvent() const override;
  Status ReadLog(EventNumber after,
                 const std::function<Status(const LogEntry&)>& visit) const override;
  Status WriteCheckpoint(const CheckpointChanges& changes) override;
  StatusOr<std::vector<CheckpointInfo>> ListCheckpoints() const override;
  StatusOr<Checkpoint> ReadCheckpoint(EventNumber last_event) const override;
  Status TrimLog(EventNumber last) override;
  Status CheckIntegrity() const override;
  StatusOr<StoredBytes> MeasureBytes() const override;

 private:
  SqliteMapStore(std::filesystem::path file,
                 const SqliteStoreOptions& options,
                 std::unique_ptr<Connection> connection,
                 LogWriter log_writer,
                 CheckpointWriter checkpoint_writer);

  Status Load();
  // Runs `body` in one transaction, when it is this thread's turn. If there is no room, the
  // write-ahead log is moved and `body` runs once more from the beginning.
  Status Write(const std::function<Status()>& body);
  Status WriteInTurn(const std::function<Status()>& body);
  Status Transact(const std::function<Status()>& body);
  Status MoveWal();
  // Keeps an error after which nothing more may be written.
  Status Remember(const Status& status);

  Status CheckChanges(const CheckpointChanges& changes) const;
  // Drops the checkpoints after `since`.
  Status Withdraw(EventNumber since);
  Status Stage(const CheckpointChanges& changes, CheckpointRow& row);
  Status StagePart(std::span<const StoredRecord> records, CheckpointRow& row);
  Status Unstage();
  Status RemoveEnded();
  Status RemoveVersions(std::span<const std::uint64_t> blob_ids);
  EventNumber NewestCheckpoint() const;

  std::shared_ptr<void> registration_;  // first: destroyed after the connections are closed
  const std::filesystem::path file_;
  const SqliteStoreOptions options_;

  // Taken for each transaction that writes. Guards the four below it.
  WriterTurn turn_;
  std::unique_ptr<Connection> connection_;
  LogWriter log_writer_;
  CheckpointWriter checkpoint_writer_;
  LogPosition end_;
  Status failure_;  // after it nothing is written any more

  std::atomic<std::uint64_t> last_event_ = 0;

  // Held for the whole of a checkpoint or trim, before turn_. Guards the two below it.
  std::mutex checkpoint_mutex_;
  std::vector<CheckpointRow> checkpoints_;  // valid ones, oldest first
  bool staged_ = false;                     // there may be versions of a checkpoint not valid

  mutable ReaderPool readers_;
};

}  // namespace loci
