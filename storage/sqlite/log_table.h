// SPDX-License-Identifier: Apache-2.0
// The tables log and log_trim: the events of a map.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "storage/sqlite/connection.h"
#include "storage/store.h"

namespace loci {

// A position between two entries: after `number`, with as many bytes before it.
struct LogPosition {
  EventNumber number;
  std::uint64_t end_bytes = 0;
};

// What of the log is there: entries after `begin` up to `end`.
struct LogBounds {
  LogPosition begin;
  LogPosition end;
};

// kDataLoss if the first entry does not follow what was trimmed.
StatusOr<LogBounds> ReadLogBounds(Connection& connection);

// Entries after `position` up to number `last`, at least one and at most about 1 MiB of them, each
// checked; moves `position` on. kDataLoss names the entry that is missing or damaged.
// `position.end_bytes` is not known to every caller: kAnyEndBytes lets the first entry say it.
inline constexpr std::uint64_t kAnyEndBytes = ~std::uint64_t{0};
StatusOr<std::vector<LogEntry>> ReadLogEntries(Connection& connection,
                                               LogPosition& position,
                                               EventNumber last);

// Writes to the log, inside the caller's transactions.
class LogWriter {
 public:
  static StatusOr<LogWriter> Prepare(Connection& connection);

  // Adds entries after `position`, which it moves on.
  Status Insert(std::span<const LogEntry> entries, LogPosition& position);

  // Removes the entries after `begin` up to number `last`.
  Status Trim(EventNumber begin, EventNumber last);

 private:
  LogWriter(Connection& connection, Statement insert)
      : connection_(&connection), insert_(std::move(insert)) {}

  Connection* connection_;
  Statement insert_;
};

}  // namespace loci
