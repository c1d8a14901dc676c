// SPDX-License-Identifier: Apache-2.0
// Reads all of a map file and checks all that can be checked without knowing what it means.
#pragma once

#include "core/base/status.h"
#include "storage/sqlite/connection.h"

namespace loci {

// Checks pages, schema, every checksum, and every reference. kDataLoss names the first damage.
// Sees one state of the file, while others may write; the write-ahead log grows until it ends.
Status CheckDatabase(Connection& connection);

}  // namespace loci
