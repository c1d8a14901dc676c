// SPDX-License-Identifier: Apache-2.0
// Tells a damaged write-ahead log from one whose last write was cut off.
#pragma once

#include <filesystem>

#include "core/base/status.h"

namespace loci {

// Reads the write-ahead log of a database that nobody has open. kDataLoss if a frame of a
// transaction that had been made durable is damaged.
//
// Why: SQLite takes the first frame with a wrong checksum for the end of the log, because a power
// cut leaves such a frame in the transaction that was being written. A flipped bit earlier would
// drop every transaction after it without a word, acknowledged ones too. But every commit here is
// durable before the next transaction is written (synchronous = FULL, in all connections), so a
// commit frame that another frame follows proves that all frames before it were whole once.
// Limit: damage in the last transaction of the log looks like a cut and is taken for one.
Status CheckWal(const std::filesystem::path& file);

}  // namespace loci
