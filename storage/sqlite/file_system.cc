// SPDX-License-Identifier: Apache-2.0
#include "storage/sqlite/file_system.h"

#include <cerrno>
#include <cstring>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

namespace loci {

StatusOr<FileDescriptor> FileDescriptor::Open(const std::filesystem::path& path, int flags) {
  const int value = ::open(path.c_str(), flags | O_CLOEXEC, 0644);
  if (value < 0) {
    return SystemFailure(errno, "opening " + path.string());
  }
  return FileDescriptor(value);
}

FileDescriptor::~FileDescriptor() {
  if (value_ >= 0) {
    ::close(value_);
  }
}

Status SystemFailure(int error, const std::string& doing) {
  const std::string message = doing + ": " + std::strerror(error);
  return error == ENOSPC || error == EDQUOT || error == EFBIG
             ? ResourceExhaustedError("the disk is full: " + message)
             : UnavailableError(message);
}

Status Sync(const FileDescriptor& descriptor, const std::filesystem::path& path) {
  return ::fsync(descriptor.value()) == 0
             ? Status()
             : SystemFailure(errno, "making " + path.string() + " durable");
}

Status SyncDirectory(const std::filesystem::path& directory) {
  LOCI_ASSIGN_OR_RETURN(const FileDescriptor descriptor,
                        FileDescriptor::Open(directory, O_RDONLY | O_DIRECTORY));
  return Sync(descriptor, directory);
}

Status RemoveFile(const std::filesystem::path& file) {
  std::error_code error;
  std::filesystem::remove(file, error);
  return error ? SystemFailure(error.value(), "removing " + file.string()) : Status();
}

Status RenameFile(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::error_code error;
  std::filesystem::rename(from, to, error);
  return error ? SystemFailure(error.value(), "renaming " + from.string()) : Status();
}

std::uint64_t FileSizeBytes(const std::filesystem::path& file) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  return error ? 0 : size;
}

}  // namespace loci
