// SPDX-License-Identifier: Apache-2.0
#include "storage/sqlite/sqlite_store.h"

#include <algorithm>
#include <cerrno>
#include <mutex>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>

#include "storage/sqlite/file_system.h"
#include "storage/sqlite/sqlite_map_store.h"

namespace loci {
namespace {

constexpr std::size_t kNameSizeMax = 64;
constexpr std::string_view kMapSuffix = ".loci";
constexpr std::string_view kNewSuffix = ".loci.new";          // being made
constexpr std::string_view kDeletedSuffix = ".loci.deleted";  // being deleted
constexpr const char* kLockName = "lock";

bool IsMapName(std::string_view name) {
  return !name.empty() && name.size() <= kNameSizeMax &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
         });
}

Status CheckMapName(std::string_view name) {
  // What is shown is short: the name may be anything.
  return IsMapName(name) ? Status()
                         : InvalidArgumentError("map: a name of " + std::to_string(name.size()) +
                                                " bytes, must match [a-z0-9_-]{1,64}");
}

// Names of the files in `directory` that are a map's name and `suffix`.
StatusOr<std::vector<std::string>> FindNames(const std::filesystem::path& directory,
                                             std::string_view suffix) {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string file = entry->path().filename().string();
    if (file.size() > suffix.size() && file.ends_with(suffix) &&
        IsMapName(std::string_view(file).substr(0, file.size() - suffix.size()))) {
      names.push_back(file.substr(0, file.size() - suffix.size()));
    }
  }
  if (error) {
    return SystemFailure(error.value(), "reading " + directory.string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

// Names of the maps that are open; shared with their stores, which take them out.
struct OpenMaps {
  std::mutex mutex;
  std::set<std::string> names;
};

class SqliteStoreDirectory final : public StoreDirectory {
 public:
  SqliteStoreDirectory(std::filesystem::path directory,
                       const SqliteStoreOptions& options,
                       FileDescriptor lock)
      : directory_(std::move(directory)), options_(options), lock_(std::move(lock)) {}

  // Finishes what a crash left half done.
  Status CleanUp();

  StatusOr<std::vector<std::string>> List() const override {
    return FindNames(directory_, kMapSuffix);
  }
  StatusOr<std::unique_ptr<MapStore>> Create(const std::string& map) override;
  StatusOr<std::unique_ptr<MapStore>> Open(const std::string& map) override;
  Status Delete(const std::string& map) override;

 private:
  std::filesystem::path FileOf(const std::string& map, std::string_view suffix) const {
    return directory_ / (map + std::string(suffix));
  }
  bool Exists(const std::string& map) const;
  bool IsOpen(const std::string& map) const;
  Status RemoveNew(const std::string& map) const;
  Status FinishDelete(const std::string& map) const;
  StatusOr<std::unique_ptr<MapStore>> OpenLocked(const std::string& map);

  const std::filesystem::path directory_;
  const SqliteStoreOptions options_;
  const FileDescriptor lock_;
  std::mutex mutex_;  // held while a map is made, opened or deleted
  const std::shared_ptr<OpenMaps> open_maps_ = std::make_shared<OpenMaps>();
};

Status SqliteStoreDirectory::CleanUp() {
  LOCI_ASSIGN_OR_RETURN(const std::vector<std::string> made, FindNames(directory_, kNewSuffix));
  for (const std::string& map : made) {
    LOCI_RETURN_IF_ERROR(RemoveNew(map));
  }
  LOCI_ASSIGN_OR_RETURN(const std::vector<std::string> deleted,
                        FindNames(directory_, kDeletedSuffix));
  for (const std::string& map : deleted) {
    LOCI_RETURN_IF_ERROR(FinishDelete(map));
  }
  return {};
}

bool SqliteStoreDirectory::Exists(const std::string& map) const {
  std::error_code error;
  return std::filesystem::exists(FileOf(map, kMapSuffix), error);
}

bool SqliteStoreDirectory::IsOpen(const std::string& map) const {
  const std::lock_guard held(open_maps_->mutex);
  return open_maps_->names.contains(map);
}

// SQLite's own files beside it go first: a file made again under the name must not meet them.
Status SqliteStoreDirectory::RemoveNew(const std::string& map) const {
  for (const char* part : {"-wal", "-shm", "-journal", ""}) {
    LOCI_RETURN_IF_ERROR(RemoveFile(FileOf(map, std::string(kNewSuffix) + part)));
  }
  return {};
}

Status SqliteStoreDirectory::FinishDelete(const std::string& map) const {
  for (const char* part : {"-wal", "-wal.new", "-shm", "-journal"}) {
    LOCI_RETURN_IF_ERROR(RemoveFile(FileOf(map, std::string(kMapSuffix) + part)));
  }
  LOCI_RETURN_IF_ERROR(SyncDirectory(directory_));
  return RemoveFile(FileOf(map, kDeletedSuffix));
}

StatusOr<std::unique_ptr<MapStore>> SqliteStoreDirectory::Create(const std::string& map) {
  LOCI_RETURN_IF_ERROR(CheckMapName(map));
  const std::lock_guard held(mutex_);
  if (Exists(map)) {
    return AlreadyExistsError("map \"" + map + "\" exists already");
  }
  // Made under another name: a map is there as a whole or not at all.
  const std::filesystem::path made = FileOf(map, kNewSuffix);
  LOCI_RETURN_IF_ERROR(RemoveNew(map));
  Status status = SqliteMapStore::Create(made, options_);
  if (status.ok()) {
    status = RenameFile(made, FileOf(map, kMapSuffix));
  }
  if (status.ok()) {
    status = SyncDirectory(directory_);
  }
  if (!status.ok()) {
    IgnoreError(RemoveNew(map), "the first error says what happened");
    return Within("making map \"" + map + "\"", status);
  }
  return OpenLocked(map);
}

StatusOr<std::unique_ptr<MapStore>> SqliteStoreDirectory::Open(const std::string& map) {
  LOCI_RETURN_IF_ERROR(CheckMapName(map));
  const std::lock_guard held(mutex_);
  return OpenLocked(map);
}

StatusOr<std::unique_ptr<MapStore>> SqliteStoreDirectory::OpenLocked(const std::string& map) {
  if (!Exists(map)) {
    return NotFoundError("there is no map \"" + map + "\"");
  }
  // Two connections of one process, opened apart, would lose each other's file locks on closing.
  if (IsOpen(map)) {
    return FailedPreconditionError("map \"" + map + "\" is open already");
  }
  const std::shared_ptr<OpenMaps> open_maps = open_maps_;
  {
    const std::lock_guard held(open_maps->mutex);
    open_maps->names.insert(map);
  }
  std::shared_ptr<void> registration(nullptr, [open_maps, map](void*) {
    const std::lock_guard held(open_maps->mutex);
    open_maps->names.erase(map);
  });
  StatusOr<std::unique_ptr<SqliteMapStore>> store =
      SqliteMapStore::Open(FileOf(map, kMapSuffix), options_, std::move(registration));
  if (!store.ok()) {
    return Within("map \"" + map + "\"", store.status());
  }
  return std::unique_ptr<MapStore>(std::move(store).value());
}

Status SqliteStoreDirectory::Delete(const std::string& map) {
  LOCI_RETURN_IF_ERROR(CheckMapName(map));
  const std::lock_guard held(mutex_);
  if (!Exists(map)) {
    return NotFoundError("there is no map \"" + map + "\"");
  }
  if (IsOpen(map)) {
    return FailedPreconditionError("map \"" + map + "\" is open");
  }
  // From here on the map is gone; a crash before the end is finished at the next start.
  LOCI_RETURN_IF_ERROR(RenameFile(FileOf(map, kMapSuffix), FileOf(map, kDeletedSuffix)));
  LOCI_RETURN_IF_ERROR(SyncDirectory(directory_));
  return FinishDelete(map);
}

// flock, not POSIX locks: those are lost when any descriptor of the file is closed.
StatusOr<FileDescriptor> LockDirectory(const std::filesystem::path& directory) {
  LOCI_ASSIGN_OR_RETURN(FileDescriptor lock,
                        FileDescriptor::Open(directory / kLockName, O_RDWR | O_CREAT));
  if (::flock(lock.value(), LOCK_EX | LOCK_NB) != 0) {
    return errno == EWOULDBLOCK
               ? FailedPreconditionError("another server uses " + directory.string() +
                                         ": stop it, or choose another directory")
               : SystemFailure(errno, "locking " + directory.string());
  }
  return lock;
}

}  // namespace

StatusOr<std::unique_ptr<StoreDirectory>> OpenSqliteDirectory(
    const std::filesystem::path& directory, const SqliteStoreOptions& options) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) {
    return SystemFailure(error.value(), "making " + directory.string());
  }
  LOCI_ASSIGN_OR_RETURN(FileDescriptor lock, LockDirectory(directory));
  auto opened = std::make_unique<SqliteStoreDirectory>(directory, options, std::move(lock));
  LOCI_RETURN_IF_ERROR(opened->CleanUp());
  return std::unique_ptr<StoreDirectory>(std::move(opened));
}

}  // namespace loci
