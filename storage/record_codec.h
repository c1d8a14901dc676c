// SPDX-License-Identifier: Apache-2.0
// Log entries and records as every driver stores them: compressed where it pays, with checksums.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/ids.h"
#include "core/base/state_record.h"
#include "core/base/status.h"

namespace loci {

// Covers the bytes, and their place in the log, so that no entry can pass for another.
std::uint32_t LogEntryChecksum(EventNumber number, std::uint64_t end_bytes, std::string_view bytes);

// A version of a record: the checkpoint that brought it, and its bytes as they are stored.
struct StoredRecord {
  std::uint32_t kind = 0;
  std::uint64_t id = 0;
  EventNumber valid_from;
  std::uint64_t size_bytes = 0;  // of the record; the stored bytes are compressed if they are fewer
  std::uint32_t checksum = 0;    // of all the other fields
  std::string bytes;
};

StoredRecord EncodeRecord(const StateRecord& record, EventNumber valid_from);
// The record, if checksum and size are right; else kDataLoss, which says what is wrong.
StatusOr<StateRecord> DecodeRecord(const StoredRecord& stored);

}  // namespace loci
