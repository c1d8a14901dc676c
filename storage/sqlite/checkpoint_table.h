// SPDX-License-Identifier: Apache-2.0
// The tables checkpoint, record and blob: states of a map.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "storage/record_codec.h"
#include "storage/sqlite/connection.h"
#include "storage/store.h"

namespace loci {

// A row of the table checkpoint.
struct CheckpointRow {
  EventNumber last_event;
  std::string state_digest;
  std::uint64_t record_count = 0;
  std::uint64_t checksum_sum = 0;  // of the checksums of its records
};

// Valid checkpoints, oldest first, each checked.
StatusOr<std::vector<CheckpointRow>> ReadCheckpointRows(Connection& connection);

// Visits the records of a checkpoint in order of kind and id, each checked, then checks that none
// is missing. kDataLoss names the record.
Status ReadCheckpointRecords(Connection& connection,
                             const CheckpointRow& checkpoint,
                             const std::function<void(StateRecord)>& visit);

// The version of a record that the given row of SELECT kRecordColumns says.
inline constexpr const char* kRecordColumns =
    "r.kind, r.id, r.valid_from, r.size_bytes, r.checksum, b.bytes, r.blob_id "
    "FROM record r LEFT JOIN blob b ON b.id = r.blob_id";
StatusOr<StateRecord> RecordOfRow(Connection& connection, const Statement& row);

// Bytes of all versions of records, apart by kind (StoredBytes::map and ::history).
StatusOr<StoredBytes> MeasureRecords(Connection& connection);

// Writes checkpoints, inside the caller's transactions.
//
// A checkpoint is staged in several transactions: its records begin at its number, and those that
// they replace end there, which no valid checkpoint sees. A last transaction adds its row and makes
// it valid. Why: one transaction for all would hold up appends for as long as it takes to write.
class CheckpointWriter {
 public:
  static StatusOr<CheckpointWriter> Prepare(Connection& connection);

  // Ends the version of (kind, id) that the checkpoint before has, if there is one.
  Status End(std::uint32_t kind, std::uint64_t id, CheckpointRow& row);
  // Adds a version, after ending the one before it.
  Status Write(const StoredRecord& stored, CheckpointRow& row);
  // Makes the checkpoint valid, and those before `oldest_kept` invalid.
  Status Publish(const CheckpointRow& row, EventNumber oldest_kept);

  // Makes the checkpoints after `last` invalid. Their versions count as staged then.
  Status Withdraw(EventNumber last);

  // Versions that were staged after the checkpoint `newest` and never became valid.
  StatusOr<std::vector<std::uint64_t>> FindStaged(EventNumber newest);
  // Versions that ended at or before the checkpoint `oldest`.
  StatusOr<std::vector<std::uint64_t>> FindEnded(EventNumber oldest);
  // Removes versions that were found.
  Status Remove(std::span<const std::uint64_t> blob_ids);
  // Takes back the ends of versions that were staged after `newest`.
  Status Reopen(EventNumber newest);

 private:
  struct Statements {
    Statement find_live;
    Statement end;
    Statement add_record;
    Statement add_blob;
    Statement remove_record;
    Statement remove_blob;
  };
  CheckpointWriter(Connection& connection, Statements statements)
      : connection_(&connection), statements_(std::move(statements)) {}

  Connection* connection_;
  Statements statements_;
};

}  // namespace loci
