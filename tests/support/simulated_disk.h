// SPDX-License-Identifier: Apache-2.0
// A disk for SQLite that loses power, tears writes, fails and fills up when a test says so.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/random.h"

struct sqlite3_vfs;

namespace loci {

// What a crash leaves of writes that were not made durable.
enum class Crash : std::uint8_t {
  kProcessKilled,     // all of them: they are in the system's page cache
  kPowerLostAll,      // none
  kPowerLostSome,     // some sectors, files and deletions, in no order
  kPowerLostGarbage,  // the same, and sectors that were being written may hold anything
};

// A layer over the machine's file system, registered as an SQLite VFS. It counts steps: writes,
// truncations, syncs and deletions. Thread-safe. Connections must be closed before it is destroyed.
//
// Nothing is really synced: the machine itself is not expected to crash.
class SimulatedDisk {
 public:
  static constexpr std::size_t kSectorSize = 512;

  SimulatedDisk();
  ~SimulatedDisk();
  SimulatedDisk(const SimulatedDisk&) = delete;
  SimulatedDisk& operator=(const SimulatedDisk&) = delete;

  const std::string& vfs_name() const { return name_; }

  std::uint64_t steps() const;
  // From the `step`-th step from now on (1: the next) nothing works; of that one, if it is a write,
  // the first half is done.
  void DieAfter(std::uint64_t step);
  // The `step`-th step from now on fails with an I/O error, once. A failed sync leaves what it
  // should have written in memory for ever, as Linux does.
  void FailOnce(std::uint64_t step);
  // How much files may grow from now on; nullopt: without limit.
  void SetFreeBytes(std::optional<std::uint64_t> free_bytes);

  // The machine is there again. All connections must be closed.
  void Restart(Crash crash, std::uint64_t seed);

 private:
  friend struct SimulatedFile;
  friend struct SimulatedVfs;

  struct Change {
    std::uint64_t offset = 0;
    std::string bytes;
    bool truncates = false;  // to `offset`
  };
  // A file that was written through this disk.
  struct FileState {
    std::string durable;
    bool exists_durably = false;
    std::uint64_t inode = 0;       // another one: replaced from outside, and durable
    bool deleted = false;          // and the deletion is not durable
    std::vector<Change> unsynced;  // in order
    std::uint64_t size = 0;
    int open_count = 0;
  };
  enum class Verdict : std::uint8_t { kDo, kFail, kDoHalf };

  Verdict Step();
  static void Apply(const Change& change, std::string& content);
  std::string AfterPowerLoss(const FileState& state, Crash crash, RandomSequence& random) const;

  std::string name_;
  std::unique_ptr<sqlite3_vfs> vfs_;
  mutable std::mutex mutex_;
  std::map<std::string, FileState> files_;
  std::uint64_t steps_ = 0;
  std::uint64_t die_at_ = 0;   // 0: never
  std::uint64_t fail_at_ = 0;  // 0: never
  bool dead_ = false;
  std::optional<std::uint64_t> free_bytes_;
};

}  // namespace loci
