// SPDX-License-Identifier: Apache-2.0
// The embedded store: one SQLite file per map in a directory. docs/storage.md describes the files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "core/base/status.h"
#include "storage/store.h"

namespace loci {

struct SqliteStoreOptions {
  // Name of a registered sqlite3_vfs through which map files are reached; empty for SQLite's
  // default. Tests set it to simulate disks.
  std::string vfs;
  // Bytes of state written in one transaction while a checkpoint is staged; an append waits for at
  // most one such transaction. Default: 1 MiB takes about 5 ms to make durable on a disk of
  // 200 MB/s, and is large enough that the fixed cost of a transaction does not count.
  std::uint64_t stage_size_bytes = 1U << 20U;
  // The write-ahead log is moved into the database when it has more frames (pages of 4 KiB), by the
  // thread that wrote the last of them. Default: SQLite's own; 4 MiB take some 10 ms.
  int wal_frames_max = 1000;
};

// Opens the store in `directory`, which is made if it is missing, and locks it until the result is
// destroyed. What a crash left half done is finished or removed.
//
// The MapStores that it opens must be destroyed before it is.
// Errors: kFailedPrecondition (another server holds the lock), kUnavailable (cannot be made, read
// or written; the message has the system's reason).
StatusOr<std::unique_ptr<StoreDirectory>> OpenSqliteDirectory(
    const std::filesystem::path& directory, const SqliteStoreOptions& options = {});

}  // namespace loci
