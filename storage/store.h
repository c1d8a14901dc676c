// SPDX-License-Identifier: Apache-2.0
// Where maps live on disk: an event log, checkpoints, and their checksums.
//
// One interface, one driver per engine (storage/sqlite; PostgreSQL later), one conformance suite.
// Nothing here knows what an event or a record means.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/ids.h"
#include "core/base/status.h"
#include "core/engine/engine.h"

namespace loci {

// Far above anything that the engine makes; a defence against running out of memory.
inline constexpr std::uint64_t kEntrySizeMax = 16U << 20U;
inline constexpr std::uint64_t kRecordSizeMax = 256U << 20U;

// One event as the log stores it. Numbers have no gaps.
struct LogEntry {
  EventNumber number;
  std::string bytes;
};

// A state of the map at one event: what changed against an earlier checkpoint.
struct CheckpointChanges {
  EventNumber last_event;
  // The checkpoint that the changes count from; 0: from nothing, so all records are given. Absent:
  // the newest one. Those that are newer are replaced: a recovery that passed over a damaged one
  // goes on from the one before it.
  std::optional<EventNumber> since = std::nullopt;
  std::string state_digest;  // hexadecimal
  std::vector<StateRecord> written;
  std::vector<std::pair<std::uint32_t, std::uint64_t>> removed;  // (kind, id)
};

// A whole checkpoint, read back.
struct Checkpoint {
  EventNumber last_event;
  std::string state_digest;
  std::vector<StateRecord> records;
};

struct CheckpointInfo {
  EventNumber last_event;
  std::string state_digest;
};

// Bytes on disk, apart by what they are for. Their sum is near the size of the files.
struct StoredBytes {
  std::uint64_t map = 0;      // what follows area: places, LTRs, mesh, graph
  std::uint64_t history = 0;  // what follows time: trajectories, sessions, closures
  std::uint64_t log = 0;      // events not yet archived
  std::uint64_t total = 0;    // of the files, write-ahead log included
};

// The store of one map. Thread-safe: one thread may append while another writes a checkpoint and
// others read.
class MapStore {
 public:
  virtual ~MapStore() = default;

  // Appends entries, whose numbers follow the last one's, all or none. When it returns OK they are
  // durable; on an error none of them is in the log and the store can be used again, except after
  // kUnavailable: then nothing more is written until the map is opened again, and only LastEvent()
  // of the map opened again tells whether they are in the log.
  // Errors: kResourceExhausted (the disk is full), kUnavailable (the disk failed),
  // kFailedPrecondition (numbers do not follow), kInvalidArgument (an entry above kEntrySizeMax).
  virtual Status Append(std::span<const LogEntry> entries) = 0;

  // Number of the last durable entry; 0 for none.
  virtual EventNumber LastEvent() const = 0;

  // Calls `visit` for each entry with a number above `after`, in order, up to the last one at the
  // time of the call; stops at its first error. `visit` may use the store.
  // kDataLoss names the entry whose checksum is wrong, or the gap; kOutOfRange if entries above
  // `after` have been trimmed.
  virtual Status ReadLog(EventNumber after,
                         const std::function<Status(const LogEntry&)>& visit) const = 0;

  // Writes a checkpoint: it is there as a whole or not at all. The two newest checkpoints are
  // kept, older ones and what only they needed are removed. A removed record that was never stored
  // is passed over. Appends are let through in between. Checkpoints that are replaced go first, so
  // after an error they may be gone; the log has what they had.
  // Errors: as Append; kFailedPrecondition if `since` is not kept (or 0 and the log is trimmed), or
  // last_event is not above `since`, or above LastEvent(); kInvalidArgument if a record is given
  // twice or is above kRecordSizeMax.
  virtual Status WriteCheckpoint(const CheckpointChanges& changes) = 0;

  // Checkpoints kept, oldest first.
  virtual StatusOr<std::vector<CheckpointInfo>> ListCheckpoints() const = 0;
  // kNotFound, or kDataLoss that names the record.
  virtual StatusOr<Checkpoint> ReadCheckpoint(EventNumber last_event) const = 0;

  // Removes log entries up to and including `last`, which no kept checkpoint needs: `last` above
  // the oldest one's last event is kFailedPrecondition. Appends are let through in between.
  virtual Status TrimLog(EventNumber last) = 0;

  // Reads everything and checks every checksum and reference; kDataLoss names the first damage.
  virtual Status CheckIntegrity() const = 0;

  virtual StatusOr<StoredBytes> MeasureBytes() const = 0;
};

// All maps of one data directory. Thread-safe. Holds a lock on the directory: a second server on
// the same directory is refused (kFailedPrecondition).
class StoreDirectory {
 public:
  virtual ~StoreDirectory() = default;

  // Names of all maps, sorted, damaged ones included.
  virtual StatusOr<std::vector<std::string>> List() const = 0;
  // kInvalidArgument (names are [a-z0-9_-]{1,64}); kAlreadyExists; kResourceExhausted.
  virtual StatusOr<std::unique_ptr<MapStore>> Create(const std::string& map) = 0;
  // kNotFound; kDataLoss says what is damaged and what to do; kFailedPrecondition for a schema
  // newer than this program, or if the map is open already.
  virtual StatusOr<std::unique_ptr<MapStore>> Open(const std::string& map) = 0;
  // kNotFound; kFailedPrecondition while the map is open. Damaged maps can be deleted.
  virtual Status Delete(const std::string& map) = 0;
};

}  // namespace loci
