// SPDX-License-Identifier: Apache-2.0
// What is done with a write-ahead log before SQLite recovers it.
#pragma once

#include <filesystem>

#include "core/base/status.h"

namespace loci {

// Checks the write-ahead log of a database that nobody has open, and makes it durable. SQLite,
// which recovers it next, does neither. kDataLoss if a frame of a transaction that had been made
// durable is damaged.
//
// Why the check: SQLite takes the first frame with a wrong checksum for the end of the log, because
// a power cut leaves such a frame in the transaction that was being written. A flipped bit earlier
// would drop every transaction after it without a word, acknowledged ones too. But every commit
// here is durable before the next transaction is written (synchronous = FULL, in all connections),
// so a commit frame that another frame follows proves that all frames before it were whole once.
// Limit: damage in the last transaction of the log looks like a cut and is taken for one.
//
// Why durable: the last transaction may be in the system's memory only, if its writer was killed
// before its fsync, or if that failed. After a failed fsync another one of the same file proves
// nothing, so the log is copied to a new file, which takes the old one's place.
Status PrepareWal(const std::filesystem::path& wal);

}  // namespace loci
