// SPDX-License-Identifier: Apache-2.0
// The schema of map files: made, recognised, migrated.
#pragma once

#include <span>

#include "core/base/status.h"
#include "storage/sqlite/connection.h"

namespace loci {

// The SQL of storage/migrations, in order; the n-th leads to schema version n (from 1).
std::span<const char* const> Migrations();

// Gives an empty database the newest schema and write-ahead logging.
Status CreateSchema(Connection& connection);

// Brings the schema of a map file up to the newest. kDataLoss if it is no map file or its schema is
// not what its version says; kFailedPrecondition if its version is newer than this program.
Status CheckAndMigrateSchema(Connection& connection);

// kDataLoss if the schema is not exactly that of the newest version.
Status CheckSchema(Connection& connection);

}  // namespace loci
