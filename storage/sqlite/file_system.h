// SPDX-License-Identifier: Apache-2.0
// The few calls of the system that the store needs beside SQLite, with our errors.
#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "core/base/status.h"

namespace loci {

// An open file; the lock that is on it goes when it is destroyed.
class FileDescriptor {
 public:
  // `flags` as open(2)'s. kResourceExhausted or kUnavailable.
  static StatusOr<FileDescriptor> Open(const std::filesystem::path& path, int flags);
  ~FileDescriptor();
  FileDescriptor(FileDescriptor&& other) noexcept : value_(std::exchange(other.value_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) = delete;
  int value() const { return value_; }

 private:
  explicit FileDescriptor(int value) : value_(value) {}
  int value_;
};

// What `error`, an errno, means for our callers.
Status SystemFailure(int error, const std::string& doing);

// Makes a file's content, or the names in a directory, durable.
Status Sync(const FileDescriptor& descriptor, const std::filesystem::path& path);
Status SyncDirectory(const std::filesystem::path& directory);

// That there is no such file is no error.
Status RemoveFile(const std::filesystem::path& file);
Status RenameFile(const std::filesystem::path& from, const std::filesystem::path& to);

// 0 if there is no such file.
std::uint64_t FileSizeBytes(const std::filesystem::path& file);

}  // namespace loci
