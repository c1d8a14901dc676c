// SPDX-License-Identifier: Apache-2.0
// SQLite's C interface with our ownership and our errors. No other file of the project calls it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/status.h"

struct sqlite3;
struct sqlite3_stmt;

namespace loci {

enum class Access : std::uint8_t {
  kRead,    // of a file that a writer has open
  kWrite,   // of a file that must be there
  kCreate,  // of a file that is made
};

// A connection to one database. One thread at a time may use it and its statements.
class Connection {
 public:
  // `vfs` as SqliteStoreOptions. An empty `file` opens an empty database in memory.
  static StatusOr<std::unique_ptr<Connection>> Open(const std::filesystem::path& file,
                                                    Access access,
                                                    const std::string& vfs);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // Runs statements that have no parameters and whose rows do not matter.
  Status Run(const char* sql);

  // Runs `body` in a transaction that writes. On an error of `body` or of the commit nothing of it
  // is kept.
  Status Transact(const std::function<Status()>& body);

  // Runs `body` in a transaction that only reads: all its statements see one state.
  Status ReadConsistently(const std::function<Status()>& body);

  // Frames in the write-ahead log after the last commit of this connection.
  int wal_frames() const { return wal_frames_; }
  // Moves the write-ahead log's content into the database, as far as readers allow, without
  // waiting.
  Status MoveWal();
  // Leaves the write-ahead log as it is when the connection is closed: for one that had an error,
  // because a failed fsync must not be tried again on the same pages.
  void KeepWalOnClose();

  // What `result`, a code of SQLite's, means for our callers.
  Status Failure(int result) const;
  // kDataLoss that names the file, says what is wrong in it and what to do.
  Status Damage(std::string_view what) const;

  sqlite3* handle() const { return handle_; }

 private:
  explicit Connection(std::string file_name) : file_name_(std::move(file_name)) {}
  Status Configure(Access access);

  std::string file_name_;  // without directories, for messages
  sqlite3* handle_ = nullptr;
  int wal_frames_ = 0;
};

// As Connection::Damage, for a file that is not open.
Status DamagedFileError(std::string_view file_name, std::string_view what);

// The same error, saying first what was being done; OK stays OK.
Status Within(std::string_view doing, const Status& status);

// A prepared statement. It must not outlive its connection.
class Statement {
 public:
  static StatusOr<Statement> Prepare(Connection& connection, const char* sql);
  ~Statement();
  Statement(Statement&& other) noexcept;
  Statement& operator=(Statement&& other) noexcept;

  // Parameters count from 1. A blob's or text's bytes must stay until the next Reset.
  Statement& Bind(int parameter, std::uint64_t value);
  Statement& BindBlob(int parameter, std::string_view bytes);
  Statement& BindText(int parameter, std::string_view text);

  // True: there is a row. False: there are no more; the statement is reset by itself.
  StatusOr<bool> Step();
  // Steps to the end and resets.
  Status Run();
  void Reset();

  // Columns count from 0; valid until the next Step or Reset. Numbers above 2^63 are stored as
  // negative ones, as SQLite has no unsigned integers.
  std::uint64_t Integer(int column) const;
  bool IsNull(int column) const;
  std::string_view Bytes(int column) const;  // of a blob or text

 private:
  Statement(Connection& connection, sqlite3_stmt* handle)
      : connection_(&connection), handle_(handle) {}
  void Check(int result);

  Connection* connection_;
  sqlite3_stmt* handle_;
  int bind_result_ = 0;  // the first failure since the last Reset
};

}  // namespace loci
