// SPDX-License-Identifier: Apache-2.0
#include "storage/sqlite/sqlite_map_store.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <string>
#include <string_view>

#include "storage/sqlite/file_system.h"
#include "storage/sqlite/integrity.h"
#include "storage/sqlite/schema.h"
#include "storage/sqlite/wal_recovery.h"

namespace loci {
namespace {

// Rows of one transaction of a trim or a removal.
constexpr std::uint64_t kRemovedRowsMax = 1000;
// A recovery may have to go back behind the newest checkpoint, if that is damaged.
constexpr std::size_t kKeptCheckpoints = 2;

std::filesystem::path WalOf(const std::filesystem::path& file) {
  return std::filesystem::path(file) += "-wal";
}

// What SQLite would not call damage: an empty file, which it takes for a new database, and one
// whose header says that it may not be written, or not be read.
Status CheckHeader(const std::filesystem::path& file) {
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  std::array<char, 20> header = {};  // magic, page size, write version, read version
  std::ifstream in(file, std::ios::binary);
  const bool read = static_cast<bool>(in.read(header.data(), header.size()));
  const bool journal = header[18] == 1 && header[19] == 1;
  const bool wal = header[18] == 2 && header[19] == 2;
  return read && std::string_view(header.data(), 16) == kMagic && (journal || wal)
             ? Status()
             : DamagedFileError(file.filename().string(),
                                "its first 20 bytes are not a database's");
}

}  // namespace

Status SqliteMapStore::Create(const std::filesystem::path& file,
                              const SqliteStoreOptions& options) {
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<Connection> connection,
                        Connection::Open(file, Access::kCreate, options.vfs));
  return CreateSchema(*connection);
}

StatusOr<std::unique_ptr<SqliteMapStore>> SqliteMapStore::Open(const std::filesystem::path& file,
                                                               const SqliteStoreOptions& options,
                                                               std::shared_ptr<void> registration) {
  LOCI_RETURN_IF_ERROR(CheckHeader(file));
  LOCI_RETURN_IF_ERROR(PrepareWal(WalOf(file)));
  LOCI_ASSIGN_OR_RETURN(std::unique_ptr<Connection> connection,
                        Connection::Open(file, Access::kWrite, options.vfs));
  LOCI_RETURN_IF_ERROR(CheckAndMigrateSchema(*connection));
  LOCI_ASSIGN_OR_RETURN(LogWriter log_writer, LogWriter::Prepare(*connection));
  LOCI_ASSIGN_OR_RETURN(CheckpointWriter checkpoint_writer, CheckpointWriter::Prepare(*connection));
  std::unique_ptr<SqliteMapStore> store(new SqliteMapStore(
      file, options, std::move(connection), std::move(log_writer), std::move(checkpoint_writer)));
  LOCI_RETURN_IF_ERROR(store->Load());
  store->registration_ = std::move(registration);
  return store;
}

SqliteMapStore::SqliteMapStore(std::filesystem::path file,
                               const SqliteStoreOptions& options,
                               std::unique_ptr<Connection> connection,
                               LogWriter log_writer,
                               CheckpointWriter checkpoint_writer)
    : file_(std::move(file)),
      options_(options),
      connection_(std::move(connection)),
      log_writer_(std::move(log_writer)),
      checkpoint_writer_(std::move(checkpoint_writer)),
      readers_(file_, options.vfs) {}

Status SqliteMapStore::Load() {
  LOCI_ASSIGN_OR_RETURN(const LogBounds bounds, ReadLogBounds(*connection_));
  LOCI_ASSIGN_OR_RETURN(checkpoints_, ReadCheckpointRows(*connection_));
  if (bounds.end.number < NewestCheckpoint()) {
    return connection_->Damage(
        "table log ends with event " + std::to_string(bounds.end.number.value) +
        ", and a checkpoint has event " + std::to_string(NewestCheckpoint().value));
  }
  if (!checkpoints_.empty() && checkpoints_.front().last_event < bounds.begin.number) {
    return connection_->Damage("table log begins after event " +
                               std::to_string(bounds.begin.number.value) +
                               ", which a checkpoint needs");
  }
  end_ = bounds.end;
  last_event_ = end_.number.value;
  // A full disk must not keep a map from being opened and read; then the next checkpoint cleans up.
  staged_ = true;
  const Status status = Unstage();
  return status.code() == StatusCode::kResourceExhausted ? Status() : status;
}

Status SqliteMapStore::Write(const std::function<Status()>& body) {
  const std::lock_guard turn(turn_);
  return WriteInTurn(body);
}

Status SqliteMapStore::WriteInTurn(const std::function<Status()>& body) {
  LOCI_RETURN_IF_ERROR(failure_);
  Status status = Transact(body);
  if (status.code() == StatusCode::kResourceExhausted && MoveWal().ok()) {
    status = Transact(body);  // what the write-ahead log held is room now
  }
  if (status.ok() && connection_->wal_frames() > options_.wal_frames_max) {
    IgnoreError(MoveWal(), "the transaction is durable where it is");
  }
  return status;
}

Status SqliteMapStore::Transact(const std::function<Status()>& body) {
  LOCI_RETURN_IF_ERROR(failure_);
  bool begun = false;
  const Status status = connection_->Transact([&] {
    begun = true;
    return body();
  });
  return begun ? Remember(status) : status;
}

Status SqliteMapStore::MoveWal() {
  return Remember(connection_->MoveWal());
}

// After a failed fsync the kernel drops what it could not write and reports it once: to try again
// would take unwritten pages for durable ones. The file is recovered from its write-ahead log when
// it is opened again. A full disk is no failure: what did not fit is known.
Status SqliteMapStore::Remember(const Status& status) {
  if (status.ok() || status.code() == StatusCode::kResourceExhausted ||
      status.code() == StatusCode::kInvalidArgument ||
      status.code() == StatusCode::kFailedPrecondition) {
    return status;
  }
  connection_->KeepWalOnClose();
  failure_ =
      Status(status.code(), status.message() + "; open the map again when the cause is removed");
  return failure_;
}

Status SqliteMapStore::Append(std::span<const LogEntry> entries) {
  if (entries.empty()) {
    return {};
  }
  const std::lock_guard turn(turn_);
  EventNumber expected = end_.number;
  for (const LogEntry& entry : entries) {
    ++expected.value;
    if (entry.number != expected) {
      return FailedPreconditionError("event number " + std::to_string(entry.number.value) +
                                     ", must be " + std::to_string(expected.value));
    }
    if (entry.bytes.size() > kEntrySizeMax) {
      return InvalidArgumentError("event " + std::to_string(entry.number.value) + ": " +
                                  std::to_string(entry.bytes.size()) + " bytes, must be at most " +
                                  std::to_string(kEntrySizeMax));
    }
  }
  LogPosition end;
  const auto insert = [&] {
    end = end_;
    return log_writer_.Insert(entries, end);
  };
  LOCI_RETURN_IF_ERROR(Within("appending events from " + std::to_string(end_.number.value + 1),
                              WriteInTurn(insert)));
  end_ = end;
  last_event_.store(end.number.value, std::memory_order_release);
  return {};
}

EventNumber SqliteMapStore::LastEvent() const {
  return {last_event_.load(std::memory_order_acquire)};
}

Status SqliteMapStore::ReadLog(EventNumber after,
                               const std::function<Status(const LogEntry&)>& visit) const {
  const EventNumber last = LastEvent();
  LogPosition position{after, kAnyEndBytes};
  LOCI_ASSIGN_OR_RETURN(const ReaderPool::Lease reader, readers_.Take());
  while (position.number < last) {
    std::vector<LogEntry> entries;
    // Short transactions: a long one would keep the write-ahead log from being moved.
    LOCI_RETURN_IF_ERROR((*reader).ReadConsistently([&]() -> Status {
      LOCI_ASSIGN_OR_RETURN(const LogBounds bounds, ReadLogBounds(*reader));
      if (position.number < bounds.begin.number) {
        return OutOfRangeError("events up to " + std::to_string(bounds.begin.number.value) +
                               " have been removed from the log; asked for those after " +
                               std::to_string(position.number.value));
      }
      LOCI_ASSIGN_OR_RETURN(entries, ReadLogEntries(*reader, position, last));
      return {};
    }));
    for (const LogEntry& entry : entries) {
      LOCI_RETURN_IF_ERROR(visit(entry));
    }
  }
  return {};
}

EventNumber SqliteMapStore::NewestCheckpoint() const {
  return checkpoints_.empty() ? EventNumber{0} : checkpoints_.back().last_event;
}

Status SqliteMapStore::CheckChanges(const CheckpointChanges& changes) const {
  const EventNumber since = changes.since.value_or(NewestCheckpoint());
  const bool is_kept =
      std::any_of(checkpoints_.begin(), checkpoints_.end(), [&](const CheckpointRow& row) {
        return row.last_event == since;
      });
  if (since.value != 0 && !is_kept) {
    return FailedPreconditionError("changes since the checkpoint of event " +
                                   std::to_string(since.value) + ", which is not kept");
  }
  if (changes.last_event <= since || changes.last_event > LastEvent()) {
    return FailedPreconditionError(
        "checkpoint of event " + std::to_string(changes.last_event.value) + ", must be above " +
        std::to_string(since.value) + " and at most " + std::to_string(LastEvent().value));
  }
  std::vector<std::pair<std::uint32_t, std::uint64_t>> names = changes.removed;
  for (const StateRecord& record : changes.written) {
    names.emplace_back(record.kind, record.id);
    if (record.bytes.size() > kRecordSizeMax) {
      return InvalidArgumentError("record of kind " + std::to_string(record.kind) + ", id " +
                                  std::to_string(record.id) + ": " +
                                  std::to_string(record.bytes.size()) + " bytes, must be at most " +
                                  std::to_string(kRecordSizeMax));
    }
  }
  std::sort(names.begin(), names.end());
  const auto twice = std::adjacent_find(names.begin(), names.end());
  if (twice != names.end()) {
    return InvalidArgumentError("record of kind " + std::to_string(twice->first) + ", id " +
                                std::to_string(twice->second) + ": is given twice");
  }
  return {};
}

Status SqliteMapStore::WriteCheckpoint(const CheckpointChanges& changes) {
  const std::lock_guard held(checkpoint_mutex_);
  LOCI_RETURN_IF_ERROR(CheckChanges(changes));
  if (changes.since.has_value() && *changes.since < NewestCheckpoint()) {
    LOCI_RETURN_IF_ERROR(Withdraw(*changes.since));
  }
  LOCI_RETURN_IF_ERROR(Unstage());
  CheckpointRow row = checkpoints_.empty() ? CheckpointRow{} : checkpoints_.back();
  row.last_event = changes.last_event;
  row.state_digest = changes.state_digest;
  std::vector<CheckpointRow> kept = checkpoints_;
  if (kept.size() >= kKeptCheckpoints) {
    kept.erase(kept.begin(), kept.end() - (kKeptCheckpoints - 1));
  }

  staged_ = true;
  Status status = Stage(changes, row);
  kept.push_back(row);
  if (status.ok()) {
    status = Write([&] { return checkpoint_writer_.Publish(row, kept.front().last_event); });
  }
  if (!status.ok()) {
    IgnoreError(Unstage(), "the next checkpoint, or the next opening, tries again");
    return Within("writing the checkpoint of event " + std::to_string(row.last_event.value),
                  status);
  }
  staged_ = false;
  checkpoints_ = std::move(kept);
  IgnoreError(RemoveEnded(), "the checkpoint is valid; the next one removes what is left");
  return {};
}

// What the checkpoint `since` had is there again when the versions after it are removed: they were
// kept for it as for the older one of two.
Status SqliteMapStore::Withdraw(EventNumber since) {
  LOCI_RETURN_IF_ERROR(
      Within("replacing the checkpoints after event " + std::to_string(since.value),
             Write([&]() -> Status {
               LOCI_ASSIGN_OR_RETURN(const LogBounds bounds, ReadLogBounds(*connection_));
               if (since < bounds.begin.number) {
                 return FailedPreconditionError("the log begins after event " +
                                                std::to_string(bounds.begin.number.value) +
                                                ": without them the map could not be recovered");
               }
               return checkpoint_writer_.Withdraw(since);
             })));
  std::erase_if(checkpoints_, [&](const CheckpointRow& row) { return row.last_event > since; });
  staged_ = true;
  return {};
}

Status SqliteMapStore::Stage(const CheckpointChanges& changes, CheckpointRow& row) {
  CheckpointRow after;
  const auto end_removed = [&]() -> Status {
    after = row;
    for (const auto& [kind, id] : changes.removed) {
      LOCI_RETURN_IF_ERROR(checkpoint_writer_.End(kind, id, after));
    }
    return {};
  };
  LOCI_RETURN_IF_ERROR(Write(end_removed));
  row = after;
  std::vector<StoredRecord> part;
  std::uint64_t size = 0;
  for (const StateRecord& record : changes.written) {
    part.push_back(EncodeRecord(record, row.last_event));  // while others may write
    size += part.back().bytes.size() + sizeof(StoredRecord);
    if (size >= options_.stage_size_bytes) {
      LOCI_RETURN_IF_ERROR(StagePart(part, row));
      part.clear();
      size = 0;
    }
  }
  return StagePart(part, row);
}

Status SqliteMapStore::StagePart(std::span<const StoredRecord> records, CheckpointRow& row) {
  CheckpointRow after;
  const auto write = [&]() -> Status {
    after = row;
    for (const StoredRecord& stored : records) {
      LOCI_RETURN_IF_ERROR(checkpoint_writer_.Write(stored, after));
    }
    return {};
  };
  LOCI_RETURN_IF_ERROR(Write(write));
  row = after;
  return {};
}

Status SqliteMapStore::Unstage() {
  if (!staged_) {
    return {};
  }
  const EventNumber newest = NewestCheckpoint();
  std::vector<std::uint64_t> staged;
  LOCI_RETURN_IF_ERROR(Write([&]() -> Status {
    LOCI_ASSIGN_OR_RETURN(staged, checkpoint_writer_.FindStaged(newest));
    return checkpoint_writer_.Reopen(newest);
  }));
  LOCI_RETURN_IF_ERROR(RemoveVersions(staged));
  staged_ = false;
  return {};
}

Status SqliteMapStore::RemoveEnded() {
  std::vector<std::uint64_t> ended;
  LOCI_RETURN_IF_ERROR(Write([&]() -> Status {
    LOCI_ASSIGN_OR_RETURN(ended, checkpoint_writer_.FindEnded(checkpoints_.front().last_event));
    return {};
  }));
  return RemoveVersions(ended);
}

Status SqliteMapStore::RemoveVersions(std::span<const std::uint64_t> blob_ids) {
  while (!blob_ids.empty()) {
    const auto part = blob_ids.first(std::min<std::size_t>(blob_ids.size(), kRemovedRowsMax));
    LOCI_RETURN_IF_ERROR(Write([&] { return checkpoint_writer_.Remove(part); }));
    blob_ids = blob_ids.subspan(part.size());
  }
  return {};
}

StatusOr<std::vector<CheckpointInfo>> SqliteMapStore::ListCheckpoints() const {
  LOCI_ASSIGN_OR_RETURN(const ReaderPool::Lease reader, readers_.Take());
  LOCI_ASSIGN_OR_RETURN(const std::vector<CheckpointRow> rows, ReadCheckpointRows(*reader));
  std::vector<CheckpointInfo> infos;
  for (const CheckpointRow& row : rows) {
    infos.push_back({.last_event = row.last_event, .state_digest = row.state_digest});
  }
  return infos;
}

StatusOr<Checkpoint> SqliteMapStore::ReadCheckpoint(EventNumber last_event) const {
  LOCI_ASSIGN_OR_RETURN(const ReaderPool::Lease reader, readers_.Take());
  Checkpoint checkpoint;
  LOCI_RETURN_IF_ERROR((*reader).ReadConsistently([&]() -> Status {
    LOCI_ASSIGN_OR_RETURN(const std::vector<CheckpointRow> rows, ReadCheckpointRows(*reader));
    const auto row = std::find_if(rows.begin(), rows.end(), [&](const CheckpointRow& candidate) {
      return candidate.last_event == last_event;
    });
    if (row == rows.end()) {
      return NotFoundError("there is no checkpoint of event " + std::to_string(last_event.value));
    }
    checkpoint.last_event = row->last_event;
    checkpoint.state_digest = row->state_digest;
    return ReadCheckpointRecords(*reader, *row, [&](StateRecord record) {
      checkpoint.records.push_back(std::move(record));
    });
  }));
  return checkpoint;
}

Status SqliteMapStore::TrimLog(EventNumber last) {
  const std::lock_guard held(checkpoint_mutex_);
  const EventNumber oldest =
      checkpoints_.empty() ? EventNumber{0} : checkpoints_.front().last_event;
  if (last > oldest) {
    return FailedPreconditionError("trimming the log up to event " + std::to_string(last.value) +
                                   ", must be at most " + std::to_string(oldest.value) +
                                   ": the oldest checkpoint needs what follows it");
  }
  for (bool more = true; more;) {
    LOCI_RETURN_IF_ERROR(
        Within("trimming the log", Write([&]() -> Status {
                 LOCI_ASSIGN_OR_RETURN(const LogBounds bounds, ReadLogBounds(*connection_));
                 const EventNumber begin = bounds.begin.number;
                 more = begin < last;
                 return more ? log_writer_.Trim(
                                   begin, {std::min(last.value, begin.value + kRemovedRowsMax)})
                             : Status();
               })));
  }
  return {};
}

Status SqliteMapStore::CheckIntegrity() const {
  // A connection of its own: those of the pool may hold pages that were read before the damage.
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<Connection> connection,
                        Connection::Open(file_, Access::kRead, options_.vfs));
  return CheckDatabase(*connection);
}

StatusOr<StoredBytes> SqliteMapStore::MeasureBytes() const {
  LOCI_ASSIGN_OR_RETURN(const ReaderPool::Lease reader, readers_.Take());
  StoredBytes bytes;
  LOCI_RETURN_IF_ERROR((*reader).ReadConsistently([&]() -> Status {
    LOCI_ASSIGN_OR_RETURN(bytes, MeasureRecords(*reader));
    LOCI_ASSIGN_OR_RETURN(const LogBounds bounds, ReadLogBounds(*reader));
    bytes.log = bounds.end.end_bytes - bounds.begin.end_bytes;
    return {};
  }));
  bytes.total = FileSizeBytes(file_) + FileSizeBytes(WalOf(file_));
  return bytes;
}

}  // namespace loci
