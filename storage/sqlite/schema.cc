// SPDX-License-Identifier: Apache-2.0
#include "storage/sqlite/schema.h"

#include <cstdint>
#include <memory>
#include <string>

namespace loci {
namespace {

constexpr std::uint32_t kApplicationId = 0x4C4F4349;  // "LOCI"

StatusOr<std::uint64_t> ReadPragma(Connection& connection, const char* sql) {
  LOCI_ASSIGN_OR_RETURN(Statement statement, Statement::Prepare(connection, sql));
  LOCI_ASSIGN_OR_RETURN(const bool row, statement.Step());
  return row ? statement.Integer(0) : 0;
}

Status Migrate(Connection& connection, std::uint64_t from_version) {
  const std::span<const char* const> migrations = Migrations();
  for (std::uint64_t version = from_version + 1; version <= migrations.size(); ++version) {
    const auto step = [&]() -> Status {
      LOCI_RETURN_IF_ERROR(connection.Run(migrations[version - 1]));
      return connection.Run(("PRAGMA user_version = " + std::to_string(version)).c_str());
    };
    LOCI_RETURN_IF_ERROR(connection.Transact(step));
  }
  return {};
}

// All that the schema consists of, as text.
StatusOr<std::string> DescribeSchema(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(
      Statement statement,
      Statement::Prepare(connection,
                         "SELECT type, name, tbl_name, sql FROM sqlite_schema ORDER BY name"));
  std::string description;
  for (;;) {
    LOCI_ASSIGN_OR_RETURN(const bool row, statement.Step());
    if (!row) {
      return description;
    }
    for (int column = 0; column < 4; ++column) {
      description.append(statement.Bytes(column)).append("\n");
    }
  }
}

}  // namespace

Status CreateSchema(Connection& connection) {
  LOCI_RETURN_IF_ERROR(
      connection.Run(("PRAGMA application_id = " + std::to_string(kApplicationId)).c_str()));
  LOCI_RETURN_IF_ERROR(connection.Run("PRAGMA journal_mode = WAL"));
  return Migrate(connection, 0);
}

Status CheckAndMigrateSchema(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(const std::uint64_t application,
                        ReadPragma(connection, "PRAGMA application_id"));
  LOCI_ASSIGN_OR_RETURN(const std::uint64_t version, ReadPragma(connection, "PRAGMA user_version"));
  if (application != kApplicationId || version == 0) {
    return connection.Damage("it is not a map file: application id " + std::to_string(application) +
                             ", must be " + std::to_string(kApplicationId) + "; schema version " +
                             std::to_string(version) + ", must be at least 1");
  }
  if (version > Migrations().size()) {
    return FailedPreconditionError("schema version " + std::to_string(version) +
                                   " is newer than this program's, " +
                                   std::to_string(Migrations().size()) +
                                   ": open the map with the program that wrote it, or a newer one");
  }
  LOCI_RETURN_IF_ERROR(connection.Run("PRAGMA journal_mode = WAL"));
  LOCI_RETURN_IF_ERROR(Migrate(connection, version));
  return CheckSchema(connection);
}

Status CheckSchema(Connection& connection) {
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<Connection> fresh,
                        Connection::Open({}, Access::kCreate, ""));
  LOCI_RETURN_IF_ERROR(Migrate(*fresh, 0));
  LOCI_ASSIGN_OR_RETURN(const std::string expected, DescribeSchema(*fresh));
  LOCI_ASSIGN_OR_RETURN(const std::string found, DescribeSchema(connection));
  return found == expected ? Status() : connection.Damage("its schema is not that of its version");
}

}  // namespace loci
