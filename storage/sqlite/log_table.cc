// SPDX-License-Identifier: Apache-2.0
#include "storage/sqlite/log_table.h"

#include <string>
#include <utility>

#include "storage/record_codec.h"

namespace loci {
namespace {

// Of one read: large enough that its fixed cost does not count, small enough to hold in memory.
constexpr std::uint64_t kReadSizeMax = 1U << 20U;

std::string NameOf(EventNumber number) {
  return "table log, event " + std::to_string(number.value);
}

// The checksum of a row of log_trim, whose entry's bytes are gone.
std::uint32_t TrimChecksum(const LogPosition& position) {
  return LogEntryChecksum(position.number, position.end_bytes, {});
}

StatusOr<LogPosition> ReadTrim(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(
      Statement statement,
      Statement::Prepare(connection, "SELECT number, end_bytes, checksum FROM log_trim"));
  LOCI_ASSIGN_OR_RETURN(const bool row, statement.Step());
  if (!row) {
    return LogPosition{};
  }
  const LogPosition position{{statement.Integer(0)}, statement.Integer(1)};
  if (statement.Integer(2) != TrimChecksum(position)) {
    return connection.Damage("table log_trim: the checksum is wrong");
  }
  return position;
}

// The position after the entry at the end of the log that `sql` gives; none if the log is empty.
StatusOr<LogPosition> ReadEnd(Connection& connection, const LogPosition& begin) {
  LOCI_ASSIGN_OR_RETURN(Statement statement,
                        Statement::Prepare(connection,
                                           "SELECT number, end_bytes, checksum, bytes FROM log "
                                           "ORDER BY number DESC LIMIT 1"));
  LOCI_ASSIGN_OR_RETURN(const bool row, statement.Step());
  if (!row) {
    return begin;
  }
  const LogPosition end{{statement.Integer(0)}, statement.Integer(1)};
  if (statement.Integer(2) != LogEntryChecksum(end.number, end.end_bytes, statement.Bytes(3))) {
    return connection.Damage(NameOf(end.number) + ": the checksum is wrong");
  }
  return end;
}

Status CheckEntry(const Connection& connection, const Statement& row, const LogPosition& position) {
  const EventNumber expected{position.number.value + 1};
  const EventNumber number{row.Integer(0)};
  if (number != expected) {
    return connection.Damage(NameOf(expected) + " is missing; the next one there is " +
                             std::to_string(number.value));
  }
  const std::string_view bytes = row.Bytes(3);
  if (row.Integer(2) != LogEntryChecksum(number, row.Integer(1), bytes)) {
    return connection.Damage(NameOf(number) + ": the checksum is wrong");
  }
  if (position.end_bytes != kAnyEndBytes && row.Integer(1) != position.end_bytes + bytes.size()) {
    return connection.Damage(NameOf(number) + ": it does not follow the entry before it");
  }
  return {};
}

}  // namespace

StatusOr<LogBounds> ReadLogBounds(Connection& connection) {
  LogBounds bounds;
  LOCI_ASSIGN_OR_RETURN(bounds.begin, ReadTrim(connection));
  LOCI_ASSIGN_OR_RETURN(bounds.end, ReadEnd(connection, bounds.begin));
  LOCI_ASSIGN_OR_RETURN(Statement first,
                        Statement::Prepare(connection, "SELECT min(number) FROM log"));
  LOCI_ASSIGN_OR_RETURN(const bool row, first.Step());
  if (row && !first.IsNull(0) && first.Integer(0) != bounds.begin.number.value + 1) {
    return connection.Damage(NameOf({bounds.begin.number.value + 1}) +
                             " is missing; the first one there is " +
                             std::to_string(first.Integer(0)));
  }
  return bounds;
}

StatusOr<std::vector<LogEntry>> ReadLogEntries(Connection& connection,
                                               LogPosition& position,
                                               EventNumber last) {
  LOCI_ASSIGN_OR_RETURN(Statement statement,
                        Statement::Prepare(connection,
                                           "SELECT number, end_bytes, checksum, bytes FROM log "
                                           "WHERE number > ?1 AND number <= ?2 ORDER BY number"));
  statement.Bind(1, position.number.value).Bind(2, last.value);
  std::vector<LogEntry> entries;
  std::uint64_t size = 0;
  while (size < kReadSizeMax) {
    const StatusOr<bool> row = statement.Step();
    if (!row.ok()) {
      return Within("reading " + NameOf({position.number.value + 1}), row.status());
    }
    if (!*row) {
      if (position.number < last) {
        return connection.Damage(NameOf({position.number.value + 1}) + " is missing");
      }
      return entries;
    }
    LOCI_RETURN_IF_ERROR(CheckEntry(connection, statement, position));
    position = {{statement.Integer(0)}, statement.Integer(1)};
    entries.push_back({.number = position.number, .bytes = std::string(statement.Bytes(3))});
    size += entries.back().bytes.size();
  }
  return entries;
}

StatusOr<LogWriter> LogWriter::Prepare(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(Statement insert,
                        Statement::Prepare(connection, "INSERT INTO log VALUES (?1, ?2, ?3, ?4)"));
  return LogWriter(connection, std::move(insert));
}

Status LogWriter::Insert(std::span<const LogEntry> entries, LogPosition& position) {
  for (const LogEntry& entry : entries) {
    position = {entry.number, position.end_bytes + entry.bytes.size()};
    insert_.Bind(1, entry.number.value)
        .Bind(2, position.end_bytes)
        .Bind(3, LogEntryChecksum(entry.number, position.end_bytes, entry.bytes))
        .BindBlob(4, entry.bytes);
    LOCI_RETURN_IF_ERROR(insert_.Run());
  }
  return {};
}

Status LogWriter::Trim(EventNumber begin, EventNumber last) {
  LOCI_ASSIGN_OR_RETURN(
      Statement find,
      Statement::Prepare(*connection_, "SELECT end_bytes FROM log WHERE number = ?1"));
  LOCI_ASSIGN_OR_RETURN(const bool row, find.Bind(1, last.value).Step());
  if (!row) {
    return connection_->Damage(NameOf(last) + " is missing");
  }
  const LogPosition position{last, find.Integer(0)};
  LOCI_ASSIGN_OR_RETURN(
      Statement mark,
      Statement::Prepare(*connection_, "INSERT OR REPLACE INTO log_trim VALUES (1, ?1, ?2, ?3)"));
  mark.Bind(1, last.value).Bind(2, position.end_bytes).Bind(3, TrimChecksum(position));
  LOCI_RETURN_IF_ERROR(mark.Run());
  LOCI_ASSIGN_OR_RETURN(
      Statement remove,
      Statement::Prepare(*connection_, "DELETE FROM log WHERE number > ?1 AND number <= ?2"));
  return remove.Bind(1, begin.value).Bind(2, last.value).Run();
}

}  // namespace loci
