// SPDX-License-Identifier: Apache-2.0
#include "storage/sqlite/checkpoint_table.h"

#include <array>
#include <cstring>
#include <limits>

#include "storage/crc32c.h"

namespace loci {
namespace {

// What checkpoint ?1 contains.
constexpr const char* kInCheckpoint =
    " WHERE r.valid_from <= ?1 AND (r.valid_until IS NULL OR r.valid_until > ?1)"
    " ORDER BY r.kind, r.id";

std::uint32_t ChecksumOf(const CheckpointRow& row) {
  const std::array<std::uint64_t, 3> numbers = {
      row.last_event.value, row.record_count, row.checksum_sum};
  std::array<char, sizeof(numbers)> bytes = {};
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return Crc32c(row.state_digest, Crc32c({bytes.data(), bytes.size()}));
}

std::string NameOf(const CheckpointRow& row) {
  return "table checkpoint, event " + std::to_string(row.last_event.value);
}

StatusOr<std::vector<std::uint64_t>> FindVersions(Connection& connection,
                                                  const char* sql,
                                                  EventNumber number) {
  LOCI_ASSIGN_OR_RETURN(Statement find, Statement::Prepare(connection, sql));
  find.Bind(1, number.value);
  std::vector<std::uint64_t> blob_ids;
  for (;;) {
    LOCI_ASSIGN_OR_RETURN(const bool row, find.Step());
    if (!row) {
      return blob_ids;
    }
    blob_ids.push_back(find.Integer(0));
  }
}

}  // namespace

StatusOr<std::vector<CheckpointRow>> ReadCheckpointRows(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(
      Statement statement,
      Statement::Prepare(connection,
                         "SELECT last_event, state_digest, record_count, checksum_sum, checksum "
                         "FROM checkpoint ORDER BY last_event"));
  std::vector<CheckpointRow> rows;
  for (;;) {
    LOCI_ASSIGN_OR_RETURN(const bool found, statement.Step());
    if (!found) {
      return rows;
    }
    const CheckpointRow row{.last_event = {statement.Integer(0)},
                            .state_digest = std::string(statement.Bytes(1)),
                            .record_count = statement.Integer(2),
                            .checksum_sum = statement.Integer(3)};
    if (statement.Integer(4) != ChecksumOf(row)) {
      return connection.Damage(NameOf(row) + ": the checksum is wrong");
    }
    rows.push_back(row);
  }
}

StatusOr<StateRecord> RecordOfRow(Connection& connection, const Statement& row) {
  StoredRecord stored;
  const std::uint64_t kind = row.Integer(0);
  stored.id = row.Integer(1);
  const std::string name = "table record, kind " + std::to_string(kind) + ", id " +
                           std::to_string(stored.id) + ", blob " + std::to_string(row.Integer(6));
  if (kind > std::numeric_limits<std::uint32_t>::max() || row.Integer(4) > 0xFFFFFFFFU) {
    return connection.Damage(name + ": a number is too large");
  }
  if (row.IsNull(5)) {
    return connection.Damage(name + ": its bytes are missing");
  }
  stored.kind = static_cast<std::uint32_t>(kind);
  stored.valid_from = {row.Integer(2)};
  stored.size_bytes = row.Integer(3);
  stored.checksum = static_cast<std::uint32_t>(row.Integer(4));
  stored.bytes = row.Bytes(5);
  StatusOr<StateRecord> record = DecodeRecord(stored);
  if (!record.ok()) {
    return connection.Damage(name + ": " + record.status().message());
  }
  return record;
}

Status ReadCheckpointRecords(Connection& connection,
                             const CheckpointRow& checkpoint,
                             const std::function<void(StateRecord)>& visit) {
  LOCI_ASSIGN_OR_RETURN(
      Statement statement,
      Statement::Prepare(connection,
                         (std::string("SELECT ") + kRecordColumns + kInCheckpoint).c_str()));
  statement.Bind(1, checkpoint.last_event.value);
  std::uint64_t count = 0;
  std::uint64_t sum = 0;
  for (;;) {
    const StatusOr<bool> row = statement.Step();
    if (!row.ok()) {
      return Within("reading record " + std::to_string(count + 1) + " of " + NameOf(checkpoint),
                    row.status());
    }
    if (!*row) {
      break;
    }
    LOCI_ASSIGN_OR_RETURN(StateRecord record, RecordOfRow(connection, statement));
    ++count;
    sum += statement.Integer(4);
    visit(std::move(record));
  }
  if (count != checkpoint.record_count || sum != checkpoint.checksum_sum) {
    return connection.Damage(NameOf(checkpoint) + ": has " + std::to_string(count) +
                             " records with checksum sum " + std::to_string(sum) + ", must have " +
                             std::to_string(checkpoint.record_count) + " with " +
                             std::to_string(checkpoint.checksum_sum));
  }
  return {};
}

StatusOr<StoredBytes> MeasureRecords(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(
      Statement statement,
      Statement::Prepare(connection,
                         "SELECT kind >= ?1, sum(stored_size_bytes) FROM record GROUP BY 1"));
  statement.Bind(1, kFirstHistoryKind);
  StoredBytes bytes;
  for (;;) {
    LOCI_ASSIGN_OR_RETURN(const bool row, statement.Step());
    if (!row) {
      return bytes;
    }
    (statement.Integer(0) != 0 ? bytes.history : bytes.map) = statement.Integer(1);
  }
}

StatusOr<CheckpointWriter> CheckpointWriter::Prepare(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(Statement find_live,
                        Statement::Prepare(connection,
                                           "SELECT blob_id, checksum FROM record "
                                           "WHERE kind = ?1 AND id = ?2 AND valid_until IS NULL"));
  LOCI_ASSIGN_OR_RETURN(
      Statement end,
      Statement::Prepare(connection, "UPDATE record SET valid_until = ?2 WHERE blob_id = ?1"));
  LOCI_ASSIGN_OR_RETURN(
      Statement add_record,
      Statement::Prepare(connection,
                         "INSERT INTO record VALUES (?1, ?2, ?3, ?4, NULL, ?5, ?6, ?7)"));
  LOCI_ASSIGN_OR_RETURN(
      Statement add_blob,
      Statement::Prepare(connection, "INSERT INTO blob (bytes) VALUES (?1) RETURNING id"));
  LOCI_ASSIGN_OR_RETURN(Statement remove_record,
                        Statement::Prepare(connection, "DELETE FROM record WHERE blob_id = ?1"));
  LOCI_ASSIGN_OR_RETURN(Statement remove_blob,
                        Statement::Prepare(connection, "DELETE FROM blob WHERE id = ?1"));
  return CheckpointWriter(connection,
                          {.find_live = std::move(find_live),
                           .end = std::move(end),
                           .add_record = std::move(add_record),
                           .add_blob = std::move(add_blob),
                           .remove_record = std::move(remove_record),
                           .remove_blob = std::move(remove_blob)});
}

Status CheckpointWriter::End(std::uint32_t kind, std::uint64_t id, CheckpointRow& row) {
  Statement& find = statements_.find_live;
  LOCI_ASSIGN_OR_RETURN(const bool found, find.Bind(1, kind).Bind(2, id).Step());
  if (!found) {
    return {};
  }
  const std::uint64_t blob_id = find.Integer(0);
  --row.record_count;
  row.checksum_sum -= find.Integer(1);
  find.Reset();
  return statements_.end.Bind(1, blob_id).Bind(2, row.last_event.value).Run();
}

Status CheckpointWriter::Write(const StoredRecord& stored, CheckpointRow& row) {
  LOCI_RETURN_IF_ERROR(End(stored.kind, stored.id, row));
  Statement& add_blob = statements_.add_blob;
  LOCI_ASSIGN_OR_RETURN(const bool added, add_blob.BindBlob(1, stored.bytes).Step());
  LOCI_CHECK(added);
  const std::uint64_t blob_id = add_blob.Integer(0);
  LOCI_RETURN_IF_ERROR(add_blob.Run());
  ++row.record_count;
  row.checksum_sum += stored.checksum;
  return statements_.add_record.Bind(1, blob_id)
      .Bind(2, stored.kind)
      .Bind(3, stored.id)
      .Bind(4, stored.valid_from.value)
      .Bind(5, stored.size_bytes)
      .Bind(6, stored.bytes.size())
      .Bind(7, stored.checksum)
      .Run();
}

Status CheckpointWriter::Publish(const CheckpointRow& row, EventNumber oldest_kept) {
  LOCI_ASSIGN_OR_RETURN(
      Statement add,
      Statement::Prepare(*connection_, "INSERT INTO checkpoint VALUES (?1, ?2, ?3, ?4, ?5)"));
  add.Bind(1, row.last_event.value)
      .BindText(2, row.state_digest)
      .Bind(3, row.record_count)
      .Bind(4, row.checksum_sum)
      .Bind(5, ChecksumOf(row));
  LOCI_RETURN_IF_ERROR(add.Run());
  LOCI_ASSIGN_OR_RETURN(
      Statement remove,
      Statement::Prepare(*connection_, "DELETE FROM checkpoint WHERE last_event < ?1"));
  return remove.Bind(1, oldest_kept.value).Run();
}

Status CheckpointWriter::Withdraw(EventNumber last) {
  LOCI_ASSIGN_OR_RETURN(
      Statement remove,
      Statement::Prepare(*connection_, "DELETE FROM checkpoint WHERE last_event > ?1"));
  return remove.Bind(1, last.value).Run();
}

StatusOr<std::vector<std::uint64_t>> CheckpointWriter::FindStaged(EventNumber newest) {
  return FindVersions(*connection_, "SELECT blob_id FROM record WHERE valid_from > ?1", newest);
}

StatusOr<std::vector<std::uint64_t>> CheckpointWriter::FindEnded(EventNumber oldest) {
  return FindVersions(*connection_,
                      "SELECT blob_id FROM record "
                      "WHERE valid_until IS NOT NULL AND valid_until <= ?1",
                      oldest);
}

Status CheckpointWriter::Remove(std::span<const std::uint64_t> blob_ids) {
  for (const std::uint64_t blob_id : blob_ids) {
    LOCI_RETURN_IF_ERROR(statements_.remove_record.Bind(1, blob_id).Run());
    LOCI_RETURN_IF_ERROR(statements_.remove_blob.Bind(1, blob_id).Run());
  }
  return {};
}

Status CheckpointWriter::Reopen(EventNumber newest) {
  LOCI_ASSIGN_OR_RETURN(Statement reopen,
                        Statement::Prepare(*connection_,
                                           "UPDATE record SET valid_until = NULL "
                                           "WHERE valid_until IS NOT NULL AND valid_until > ?1"));
  return reopen.Bind(1, newest.value).Run();
}

}  // namespace loci
