// SPDX-License-Identifier: Apache-2.0
#include "tests/support/simulated_disk.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <new>
#include <utility>

#include <sqlite3.h>
#include <sys/stat.h>

#include "core/base/check.h"

namespace loci {
namespace {

std::string ReadAll(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void WriteAll(const std::filesystem::path& file, const std::string& content) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(content.data(), static_cast<std::streamsize>(content.size()));
  LOCI_CHECK(out.good());
}

std::uint64_t InodeOf(const char* path) {
  struct stat status = {};
  return ::stat(path, &status) == 0 ? status.st_ino : 0;
}

sqlite3_vfs* RealVfs() {
  return sqlite3_vfs_find("unix");
}

}  // namespace

// SQLite sees `base`; the real file's object lies behind this one in the same memory.
struct SimulatedFile {
  sqlite3_file base;
  SimulatedDisk* disk;
  SimulatedDisk::FileState* state;  // null for files that are not followed

  static SimulatedFile* Of(sqlite3_file* file) { return reinterpret_cast<SimulatedFile*>(file); }
  sqlite3_file* real() { return reinterpret_cast<sqlite3_file*>(this + 1); }

  static int Close(sqlite3_file* file) {
    SimulatedFile* self = Of(file);
    if (self->state != nullptr) {
      const std::lock_guard held(self->disk->mutex_);
      --self->state->open_count;
    }
    return self->real()->pMethods->xClose(self->real());
  }
  static int Read(sqlite3_file* file, void* to, int size, sqlite3_int64 offset) {
    SimulatedFile* self = Of(file);
    {
      const std::lock_guard held(self->disk->mutex_);
      if (self->disk->dead_) {
        return SQLITE_IOERR_READ;
      }
    }
    return self->real()->pMethods->xRead(self->real(), to, size, offset);
  }
  static int Write(sqlite3_file* file, const void* from, int size, sqlite3_int64 offset) {
    SimulatedFile* self = Of(file);
    const std::lock_guard held(self->disk->mutex_);
    const SimulatedDisk::Verdict verdict = self->disk->Step();
    if (verdict == SimulatedDisk::Verdict::kFail) {
      return SQLITE_IOERR_WRITE;
    }
    int part = verdict == SimulatedDisk::Verdict::kDoHalf ? size / 2 : size;
    const bool fits = self->TakeSpace(offset, part);
    SimulatedDisk::Change change{
        static_cast<std::uint64_t>(offset),
        std::string(static_cast<const char*>(from), static_cast<std::size_t>(part)),
        false};
    self->state->size =
        std::max<std::uint64_t>(self->state->size, change.offset + change.bytes.size());
    self->state->unsynced.push_back(std::move(change));
    const int result = self->real()->pMethods->xWrite(self->real(), from, part, offset);
    if (result != SQLITE_OK) {
      return result;
    }
    if (!fits) {
      return SQLITE_FULL;
    }
    return part == size ? SQLITE_OK : SQLITE_IOERR_WRITE;
  }
  // Shortens `size` to what the disk has room for.
  bool TakeSpace(sqlite3_int64 offset, int& size) {
    std::optional<std::uint64_t>& free_bytes = disk->free_bytes_;
    const std::uint64_t end = static_cast<std::uint64_t>(offset) + static_cast<std::uint64_t>(size);
    if (!free_bytes.has_value() || end <= state->size) {
      return true;
    }
    const std::uint64_t wanted = end - state->size;
    const std::uint64_t granted = std::min(wanted, *free_bytes);
    *free_bytes -= granted;
    size -= static_cast<int>(
        std::min<std::uint64_t>(wanted - granted, static_cast<std::uint64_t>(size)));
    return granted == wanted;
  }
  static int Truncate(sqlite3_file* file, sqlite3_int64 size) {
    SimulatedFile* self = Of(file);
    const std::lock_guard held(self->disk->mutex_);
    if (self->disk->Step() != SimulatedDisk::Verdict::kDo) {
      return SQLITE_IOERR_TRUNCATE;
    }
    const auto new_size = static_cast<std::uint64_t>(size);
    if (self->disk->free_bytes_.has_value() && new_size < self->state->size) {
      *self->disk->free_bytes_ += self->state->size - new_size;
    }
    self->state->size = new_size;
    self->state->unsynced.push_back({new_size, "", true});
    return self->real()->pMethods->xTruncate(self->real(), size);
  }
  static int Sync(sqlite3_file* file, int /*flags*/) {
    SimulatedFile* self = Of(file);
    const std::lock_guard held(self->disk->mutex_);
    SimulatedDisk::FileState& state = *self->state;
    const SimulatedDisk::Verdict verdict = self->disk->Step();
    if (verdict == SimulatedDisk::Verdict::kFail && !self->disk->dead_) {
      state.unsynced.clear();  // what was to be written never will be
    }
    if (verdict != SimulatedDisk::Verdict::kDo) {
      return SQLITE_IOERR_FSYNC;
    }
    for (const SimulatedDisk::Change& change : state.unsynced) {
      SimulatedDisk::Apply(change, state.durable);
    }
    state.unsynced.clear();
    state.exists_durably = true;
    return SQLITE_OK;
  }
  static int FileSize(sqlite3_file* file, sqlite3_int64* size) {
    SimulatedFile* self = Of(file);
    return self->real()->pMethods->xFileSize(self->real(), size);
  }
  static int Lock(sqlite3_file* file, int level) {
    return Of(file)->real()->pMethods->xLock(Of(file)->real(), level);
  }
  static int Unlock(sqlite3_file* file, int level) {
    return Of(file)->real()->pMethods->xUnlock(Of(file)->real(), level);
  }
  static int CheckReservedLock(sqlite3_file* file, int* out) {
    return Of(file)->real()->pMethods->xCheckReservedLock(Of(file)->real(), out);
  }
  static int FileControl(sqlite3_file* file, int operation, void* argument) {
    return Of(file)->real()->pMethods->xFileControl(Of(file)->real(), operation, argument);
  }
  static int SectorSize(sqlite3_file* file) {
    return Of(file)->real()->pMethods->xSectorSize(Of(file)->real());
  }
  static int DeviceCharacteristics(sqlite3_file* file) {
    return Of(file)->real()->pMethods->xDeviceCharacteristics(Of(file)->real());
  }
  static int ShmMap(sqlite3_file* file, int page, int size, int extend, void volatile** out) {
    return Of(file)->real()->pMethods->xShmMap(Of(file)->real(), page, size, extend, out);
  }
  static int ShmLock(sqlite3_file* file, int offset, int count, int flags) {
    return Of(file)->real()->pMethods->xShmLock(Of(file)->real(), offset, count, flags);
  }
  static void ShmBarrier(sqlite3_file* file) {
    Of(file)->real()->pMethods->xShmBarrier(Of(file)->real());
  }
  static int ShmUnmap(sqlite3_file* file, int remove) {
    return Of(file)->real()->pMethods->xShmUnmap(Of(file)->real(), remove);
  }
};

// The functions of the VFS that are not the real one's.
struct SimulatedVfs {
  static SimulatedDisk* DiskOf(sqlite3_vfs* vfs) {
    return static_cast<SimulatedDisk*>(vfs->pAppData);
  }

  static int Open(sqlite3_vfs* vfs, const char* path, sqlite3_file* file, int flags, int* out) {
    static constexpr sqlite3_io_methods kMethods = {
        2,  // version: with shared memory, without memory mapping
        SimulatedFile::Close,
        SimulatedFile::Read,
        SimulatedFile::Write,
        SimulatedFile::Truncate,
        SimulatedFile::Sync,
        SimulatedFile::FileSize,
        SimulatedFile::Lock,
        SimulatedFile::Unlock,
        SimulatedFile::CheckReservedLock,
        SimulatedFile::FileControl,
        SimulatedFile::SectorSize,
        SimulatedFile::DeviceCharacteristics,
        SimulatedFile::ShmMap,
        SimulatedFile::ShmLock,
        SimulatedFile::ShmBarrier,
        SimulatedFile::ShmUnmap,
        nullptr,
        nullptr,
    };
    auto* self = new (file) SimulatedFile{{nullptr}, DiskOf(vfs), nullptr};
    const std::lock_guard held(self->disk->mutex_);
    if (self->disk->dead_) {
      return SQLITE_CANTOPEN;
    }
    LOCI_CHECK(path != nullptr);  // temporary files lie in memory
    const bool existed = std::filesystem::exists(path);
    const int result = RealVfs()->xOpen(RealVfs(), path, self->real(), flags, out);
    if (result != SQLITE_OK) {
      return result;
    }
    SimulatedDisk::FileState& state = self->disk->files_[path];
    if (state.open_count == 0 && state.inode != InodeOf(path)) {
      state = {};
      state.inode = InodeOf(path);
      state.exists_durably = existed;
      state.durable = existed ? ReadAll(path) : "";
      state.size = state.durable.size();
    }
    ++state.open_count;
    self->state = &state;
    self->base.pMethods = &kMethods;
    return SQLITE_OK;
  }

  static int Delete(sqlite3_vfs* vfs, const char* path, int sync_directory) {
    SimulatedDisk* disk = DiskOf(vfs);
    const std::lock_guard held(disk->mutex_);
    if (disk->Step() != SimulatedDisk::Verdict::kDo) {
      return SQLITE_IOERR_DELETE;
    }
    const auto found = disk->files_.find(path);
    if (found != disk->files_.end()) {
      if (disk->free_bytes_.has_value()) {
        *disk->free_bytes_ += found->second.size;
      }
      found->second.unsynced.clear();
      found->second.inode = 0;
      found->second.size = 0;
      found->second.deleted = sync_directory == 0 && found->second.exists_durably;
      found->second.exists_durably = false;
    }
    return RealVfs()->xDelete(RealVfs(), path, 0);
  }
};

SimulatedDisk::SimulatedDisk() {
  static std::atomic<int> count = 0;
  name_ = "simulated-disk-" + std::to_string(++count);
  vfs_ = std::make_unique<sqlite3_vfs>(*RealVfs());
  vfs_->szOsFile += static_cast<int>(sizeof(SimulatedFile));
  vfs_->pNext = nullptr;
  vfs_->zName = name_.c_str();
  vfs_->pAppData = this;
  vfs_->xOpen = SimulatedVfs::Open;
  vfs_->xDelete = SimulatedVfs::Delete;
  LOCI_CHECK(sqlite3_vfs_register(vfs_.get(), 0) == SQLITE_OK);
}

SimulatedDisk::~SimulatedDisk() {
  sqlite3_vfs_unregister(vfs_.get());
}

std::uint64_t SimulatedDisk::steps() const {
  const std::lock_guard held(mutex_);
  return steps_;
}

void SimulatedDisk::DieAfter(std::uint64_t step) {
  const std::lock_guard held(mutex_);
  die_at_ = steps_ + step;
}

void SimulatedDisk::FailOnce(std::uint64_t step) {
  const std::lock_guard held(mutex_);
  fail_at_ = steps_ + step;
}

void SimulatedDisk::SetFreeBytes(std::optional<std::uint64_t> free_bytes) {
  const std::lock_guard held(mutex_);
  free_bytes_ = free_bytes;
}

SimulatedDisk::Verdict SimulatedDisk::Step() {
  if (dead_) {
    return Verdict::kFail;
  }
  ++steps_;
  if (steps_ == die_at_) {
    dead_ = true;
    return Verdict::kDoHalf;
  }
  return steps_ == fail_at_ ? Verdict::kFail : Verdict::kDo;
}

void SimulatedDisk::Apply(const Change& change, std::string& content) {
  if (change.truncates) {
    content.resize(change.offset);
    return;
  }
  if (content.size() < change.offset + change.bytes.size()) {
    content.resize(change.offset + change.bytes.size());
  }
  content.replace(change.offset, change.bytes.size(), change.bytes);
}

std::string SimulatedDisk::AfterPowerLoss(const FileState& state,
                                          Crash crash,
                                          RandomSequence& random) const {
  std::string content = state.durable;
  if (crash == Crash::kPowerLostAll) {
    return content;
  }
  const std::array<double, 3> shares = {0.1, 0.5, 0.9};
  const double kept_share = shares[random.NextBits() % shares.size()];
  for (const Change& change : state.unsynced) {
    if (change.truncates) {
      if (random.NextUnit() < kept_share) {
        Apply(change, content);
      }
      continue;
    }
    for (std::size_t done = 0; done < change.bytes.size();) {
      const std::uint64_t at = change.offset + done;
      const std::size_t size =
          std::min<std::size_t>(change.bytes.size() - done, kSectorSize - at % kSectorSize);
      Change sector{at, change.bytes.substr(done, size), false};
      if (crash == Crash::kPowerLostGarbage && random.NextUnit() < 0.1) {
        std::generate(sector.bytes.begin(), sector.bytes.end(), [&] {
          return static_cast<char>(random.NextBits());
        });
      }
      if (random.NextUnit() < kept_share) {
        Apply(sector, content);
      }
      done += size;
    }
  }
  return content;
}

void SimulatedDisk::Restart(Crash crash, std::uint64_t seed) {
  const std::lock_guard held(mutex_);
  RandomSequence random(seed);
  for (auto& [path, state] : files_) {
    LOCI_CHECK(state.open_count == 0);
    if (crash == Crash::kProcessKilled) {
      continue;  // the page cache keeps everything, and what is not durable stays so
    }
    std::filesystem::remove(path + "-shm");
    const bool some = crash != Crash::kPowerLostAll;
    const bool back = state.deleted && (!some || random.NextUnit() < 0.5);
    const bool made = !state.unsynced.empty() && some && random.NextUnit() < 0.5;
    if (state.exists_durably || back || made) {
      WriteAll(path, AfterPowerLoss(state, crash, random));
    } else {
      std::filesystem::remove(path);
    }
  }
  if (crash != Crash::kProcessKilled) {
    files_.clear();  // what is there now is durable
  }
  die_at_ = 0;
  fail_at_ = 0;
  dead_ = false;
  free_bytes_.reset();
}

}  // namespace loci
