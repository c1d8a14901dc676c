// SPDX-License-Identifier: Apache-2.0
#include "storage/sqlite/integrity.h"

#include <string>

#include "storage/sqlite/checkpoint_table.h"
#include "storage/sqlite/log_table.h"
#include "storage/sqlite/schema.h"

namespace loci {
namespace {

// B-trees, free pages, indices against tables: what SQLite knows of its own file.
Status CheckPages(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(Statement statement,
                        Statement::Prepare(connection, "PRAGMA integrity_check(1)"));
  LOCI_ASSIGN_OR_RETURN(const bool row, statement.Step());
  const std::string answer(row ? statement.Bytes(0) : "no answer");
  return answer == "ok" ? Status() : connection.Damage(answer);
}

Status CheckLog(Connection& connection, const LogBounds& bounds) {
  LogPosition position = bounds.begin;
  while (position.number < bounds.end.number) {
    LOCI_RETURN_IF_ERROR(ReadLogEntries(connection, position, bounds.end.number).status());
  }
  return {};
}

Status CheckCheckpoints(Connection& connection, const LogBounds& bounds) {
  LOCI_ASSIGN_OR_RETURN(const std::vector<CheckpointRow> rows, ReadCheckpointRows(connection));
  for (const CheckpointRow& row : rows) {
    if (row.last_event < bounds.begin.number || row.last_event > bounds.end.number) {
      return connection.Damage(
          "table checkpoint has event " + std::to_string(row.last_event.value) +
          ", and the log goes on from " + std::to_string(bounds.begin.number.value) + " to " +
          std::to_string(bounds.end.number.value));
    }
    LOCI_RETURN_IF_ERROR(ReadCheckpointRecords(connection, row, [](const StateRecord&) {}));
  }
  return {};
}

// Versions that no checkpoint has: staged, or ended and not removed yet.
Status CheckOtherVersions(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(
      Statement statement,
      Statement::Prepare(connection,
                         (std::string("SELECT ") + kRecordColumns +
                          " WHERE NOT EXISTS (SELECT 1 FROM checkpoint c"
                          " WHERE r.valid_from <= c.last_event"
                          " AND (r.valid_until IS NULL OR r.valid_until > c.last_event))")
                             .c_str()));
  for (;;) {
    LOCI_ASSIGN_OR_RETURN(const bool row, statement.Step());
    if (!row) {
      return {};
    }
    LOCI_RETURN_IF_ERROR(RecordOfRow(connection, statement).status());
  }
}

Status CheckBlobsAreNamed(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(
      Statement statement,
      Statement::Prepare(connection,
                         "SELECT id FROM blob WHERE id NOT IN (SELECT blob_id FROM record) "
                         "LIMIT 1"));
  LOCI_ASSIGN_OR_RETURN(const bool row, statement.Step());
  return row ? connection.Damage("table blob, id " + std::to_string(statement.Integer(0)) +
                                 ": no record has it")
             : Status();
}

}  // namespace

Status CheckDatabase(Connection& connection) {
  return connection.ReadConsistently([&]() -> Status {
    LOCI_RETURN_IF_ERROR(CheckSchema(connection));
    LOCI_RETURN_IF_ERROR(CheckPages(connection));
    LOCI_ASSIGN_OR_RETURN(const LogBounds bounds, ReadLogBounds(connection));
    LOCI_RETURN_IF_ERROR(CheckLog(connection, bounds));
    LOCI_RETURN_IF_ERROR(CheckCheckpoints(connection, bounds));
    LOCI_RETURN_IF_ERROR(CheckOtherVersions(connection));
    return CheckBlobsAreNamed(connection);
  });
}

}  // namespace loci
