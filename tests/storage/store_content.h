// SPDX-License-Identifier: Apache-2.0
// What tests put into stores, and all that can be read back from one.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/base/state_record.h"
#include "storage/store.h"

namespace loci {

// The bytes of event `number`: the same for every test, of changing length.
inline std::string EventBytes(std::uint64_t number) {
  RandomSequence random(number);
  std::string bytes(20 + random.NextBits() % 100, '\0');
  for (char& byte : bytes) {
    byte = static_cast<char>(random.NextBits());
  }
  return bytes;
}

// Entries `first` to `last`.
inline std::vector<LogEntry> Entries(std::uint64_t first, std::uint64_t last) {
  std::vector<LogEntry> entries;
  for (std::uint64_t number = first; number <= last; ++number) {
    entries.push_back({.number = {number}, .bytes = EventBytes(number)});
  }
  return entries;
}

inline StateRecord Record(std::uint32_t kind, std::uint64_t id, std::string bytes) {
  return {.kind = kind, .id = id, .bytes = std::move(bytes)};
}

inline CheckpointChanges Changes(std::uint64_t last_event,
                                 std::vector<StateRecord> written,
                                 std::optional<EventNumber> since = std::nullopt) {
  return {.last_event = {last_event},
          .since = since,
          .state_digest = "digest-" + std::to_string(last_event),
          .written = std::move(written),
          .removed = {}};
}

// Records as text, in the order in which the store gives them.
inline std::string Describe(const Checkpoint& checkpoint) {
  std::string text = std::to_string(checkpoint.last_event.value) + " " + checkpoint.state_digest;
  for (const StateRecord& record : checkpoint.records) {
    text += " [" + std::to_string(record.kind) + " " + std::to_string(record.id) + " " +
            record.bytes + "]";
  }
  return text;
}

// All that a map's store holds, as text; an error if any of it cannot be read.
inline StatusOr<std::string> DescribeStore(const MapStore& store, std::uint64_t after = 0) {
  std::string text = "last " + std::to_string(store.LastEvent().value) + "\n";
  LOCI_RETURN_IF_ERROR(store.ReadLog({after}, [&](const LogEntry& entry) {
    text += std::to_string(entry.number.value) + " " + entry.bytes + "\n";
    return Status();
  }));
  LOCI_ASSIGN_OR_RETURN(const std::vector<CheckpointInfo> infos, store.ListCheckpoints());
  for (const CheckpointInfo& info : infos) {
    LOCI_ASSIGN_OR_RETURN(const Checkpoint checkpoint, store.ReadCheckpoint(info.last_event));
    text += Describe(checkpoint) + "\n";
  }
  return text;
}

}  // namespace loci
