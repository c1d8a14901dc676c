// SPDX-License-Identifier: Apache-2.0
#include "storage/sqlite/connection.h"

#include <cerrno>
#include <cstring>
#include <utility>

#include <sqlite3.h>

#include "storage/store.h"

namespace loci {
namespace {

// For a lock that another process holds: an operator who looks into the file with sqlite3.
constexpr int kBusyTimeoutMs = 5000;

// A transaction must not leave files beside the map's; a map file is never trusted to run code.
// journal_size_limit: a write-ahead log that a long reader made large shrinks again.
// secure_delete: Debian's SQLite overwrites what is deleted, which would double a trim's writes.
constexpr const char* kSettings =
    "PRAGMA mmap_size = 0;"
    "PRAGMA temp_store = MEMORY;"
    "PRAGMA trusted_schema = OFF;"
    "PRAGMA cell_size_check = ON;"
    "PRAGMA secure_delete = OFF;"
    "PRAGMA synchronous = FULL;"
    "PRAGMA wal_autocheckpoint = 0;"
    "PRAGMA journal_size_limit = 16777216;";

// Whether a failed write means that there is no room, though SQLite calls it an I/O error.
bool MeansNoRoom(int result, int system_error) {
  if (result == SQLITE_IOERR_SHMSIZE) {  // the index of the write-ahead log could not grow
    return true;
  }
  const bool no_room = system_error == ENOSPC || system_error == EDQUOT || system_error == EFBIG;
  return no_room && (result == SQLITE_IOERR_WRITE || result == SQLITE_IOERR_TRUNCATE ||
                     result == SQLITE_IOERR_SHMOPEN || (result & 0xFF) == SQLITE_CANTOPEN);
}

int CountWalFrames(void* wal_frames, sqlite3* /*handle*/, const char* /*name*/, int frames) {
  *static_cast<int*>(wal_frames) = frames;
  return SQLITE_OK;
}

}  // namespace

StatusOr<std::unique_ptr<Connection>> Connection::Open(const std::filesystem::path& file,
                                                       Access access,
                                                       const std::string& vfs) {
  std::unique_ptr<Connection> connection(
      new Connection(file.empty() ? "(memory)" : file.filename().string()));
  const int create = access == Access::kCreate ? SQLITE_OPEN_CREATE : 0;
  const int result = sqlite3_open_v2(file.empty() ? ":memory:" : file.c_str(),
                                     &connection->handle_,
                                     SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX | create,
                                     vfs.empty() ? nullptr : vfs.c_str());
  if (result != SQLITE_OK) {
    return connection->Failure(result);
  }
  LOCI_RETURN_IF_ERROR(connection->Configure(access));
  return connection;
}

Status Connection::Configure(Access access) {
  sqlite3_extended_result_codes(handle_, 1);
  sqlite3_busy_timeout(handle_, kBusyTimeoutMs);
  sqlite3_limit(handle_, SQLITE_LIMIT_LENGTH, static_cast<int>(kRecordSizeMax) + (1 << 20));
  for (const int option : {SQLITE_DBCONFIG_ENABLE_TRIGGER, SQLITE_DBCONFIG_ENABLE_VIEW}) {
    sqlite3_db_config(handle_, option, 0, nullptr);
  }
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_wal_hook(handle_, CountWalFrames, &wal_frames_);
  LOCI_RETURN_IF_ERROR(Run(kSettings));
  return access == Access::kRead ? Run("PRAGMA query_only = ON") : Status();
}

Connection::~Connection() {
  sqlite3_close_v2(handle_);
}

Status Connection::Run(const char* sql) {
  errno = 0;  // for Failure
  const int result = sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr);
  return result == SQLITE_OK ? Status() : Failure(result);
}

Status Connection::Transact(const std::function<Status()>& body) {
  LOCI_RETURN_IF_ERROR(Run("BEGIN IMMEDIATE"));
  Status status = body();
  if (status.ok()) {
    status = Run("COMMIT");
  }
  if (!status.ok() && sqlite3_get_autocommit(handle_) == 0) {
    IgnoreError(Run("ROLLBACK"), "the first error says what happened");
  }
  return status;
}

Status Connection::ReadConsistently(const std::function<Status()>& body) {
  LOCI_RETURN_IF_ERROR(Run("BEGIN"));
  Status status = body();
  const Status end = Run("COMMIT");
  return status.ok() ? end : status;
}

Status Connection::MoveWal() {
  errno = 0;  // for Failure
  const int result =
      sqlite3_wal_checkpoint_v2(handle_, nullptr, SQLITE_CHECKPOINT_PASSIVE, nullptr, nullptr);
  return result == SQLITE_OK || result == SQLITE_BUSY ? Status() : Failure(result);
}

void Connection::KeepWalOnClose() {
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
}

Status Connection::Failure(int result) const {
  // SQLite's own note of the system's error is not of this call when a COMMIT failed: it takes none
  // then. So errno comes first, which was cleared before the call.
  const int last_error = errno;
  const int noted_error = handle_ == nullptr ? 0 : sqlite3_system_errno(handle_);
  const int system_error = last_error != 0 ? last_error : noted_error;
  const char* text = handle_ == nullptr ? sqlite3_errstr(result) : sqlite3_errmsg(handle_);
  std::string message = file_name_ + ": " + text + " (SQLite code " + std::to_string(result);
  if (system_error != 0) {
    message += std::string(", ") + std::strerror(system_error);
  }
  message += ")";
  if (MeansNoRoom(result, system_error)) {
    return ResourceExhaustedError("the disk is full: " + message);
  }
  switch (result & 0xFF) {
    case SQLITE_FULL:
      return ResourceExhaustedError("the disk is full: " + message);
    case SQLITE_NOMEM:
      return ResourceExhaustedError("out of memory: " + message);
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
    case SQLITE_FORMAT:
    case SQLITE_MISMATCH:
    case SQLITE_CONSTRAINT:  // our rows obey the schema: those in the file do not
    case SQLITE_ERROR:       // our statements are tested: the schema in the file is another one
      return DamagedFileError(file_name_, text);
    case SQLITE_IOERR:
      if (result == SQLITE_IOERR_SHORT_READ || result == SQLITE_IOERR_CORRUPTFS) {
        return DamagedFileError(file_name_, text);
      }
      return UnavailableError("the disk failed: " + message);
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return UnavailableError("another process uses the file: " + message);
    case SQLITE_PERM:
    case SQLITE_AUTH:
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
      return UnavailableError("the file cannot be opened or written: " + message);
    case SQLITE_TOOBIG:
      return InvalidArgumentError(message);
    default:
      return InternalError(message);
  }
}

Status Connection::Damage(std::string_view what) const {
  return DamagedFileError(file_name_, what);
}

Status DamagedFileError(std::string_view file_name, std::string_view what) {
  return DataLossError(std::string(file_name) + " is damaged: " + std::string(what) +
                       "; restore the map from a backup, or delete it");
}

Status Within(std::string_view doing, const Status& status) {
  return status.ok() ? Status()
                     : Status(status.code(), std::string(doing) + ": " + status.message());
}

StatusOr<Statement> Statement::Prepare(Connection& connection, const char* sql) {
  sqlite3_stmt* handle = nullptr;
  const int result = sqlite3_prepare_v2(connection.handle(), sql, -1, &handle, nullptr);
  if (result != SQLITE_OK) {
    return connection.Failure(result);
  }
  return Statement(connection, handle);
}

Statement::~Statement() {
  sqlite3_finalize(handle_);
}

Statement::Statement(Statement&& other) noexcept
    : connection_(other.connection_),
      handle_(std::exchange(other.handle_, nullptr)),
      bind_result_(other.bind_result_) {}

Statement& Statement::operator=(Statement&& other) noexcept {
  std::swap(connection_, other.connection_);
  std::swap(handle_, other.handle_);
  std::swap(bind_result_, other.bind_result_);
  return *this;
}

void Statement::Check(int result) {
  if (bind_result_ == SQLITE_OK) {
    bind_result_ = result;
  }
}

Statement& Statement::Bind(int parameter, std::uint64_t value) {
  Check(sqlite3_bind_int64(handle_, parameter, static_cast<sqlite3_int64>(value)));
  return *this;
}

Statement& Statement::BindBlob(int parameter, std::string_view bytes) {
  // An empty view may be null, and a null pointer would bind NULL.
  const char* data = bytes.empty() ? "" : bytes.data();
  Check(sqlite3_bind_blob64(handle_, parameter, data, bytes.size(), SQLITE_STATIC));
  return *this;
}

Statement& Statement::BindText(int parameter, std::string_view text) {
  const char* data = text.empty() ? "" : text.data();
  Check(sqlite3_bind_text64(handle_, parameter, data, text.size(), SQLITE_STATIC, SQLITE_UTF8));
  return *this;
}

StatusOr<bool> Statement::Step() {
  errno = 0;  // for Connection::Failure
  const int result = bind_result_ == SQLITE_OK ? sqlite3_step(handle_) : bind_result_;
  if (result == SQLITE_ROW) {
    return true;
  }
  const Status status = result == SQLITE_DONE ? Status() : connection_->Failure(result);
  Reset();
  if (!status.ok()) {
    return status;
  }
  return false;
}

Status Statement::Run() {
  for (;;) {
    LOCI_ASSIGN_OR_RETURN(const bool row, Step());
    if (!row) {
      return {};
    }
  }
}

void Statement::Reset() {
  sqlite3_reset(handle_);  // gives the error of the last step again
  sqlite3_clear_bindings(handle_);
  bind_result_ = SQLITE_OK;
}

std::uint64_t Statement::Integer(int column) const {
  return static_cast<std::uint64_t>(sqlite3_column_int64(handle_, column));
}

bool Statement::IsNull(int column) const {
  return sqlite3_column_type(handle_, column) == SQLITE_NULL;
}

std::string_view Statement::Bytes(int column) const {
  const void* data = sqlite3_column_blob(handle_, column);
  const int size = sqlite3_column_bytes(handle_, column);
  return {static_cast<const char*>(data), data == nullptr ? 0 : static_cast<std::size_t>(size)};
}

}  // namespace loci
