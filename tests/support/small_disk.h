// SPDX-License-Identifier: Apache-2.0
// A file system of a few megabytes, to be filled.
#pragma once

#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <sys/mount.h>

#include "tests/support/temporary_directory.h"

namespace loci {

// A tmpfs, which needs the right to mount.
class SmallDisk {
 public:
  explicit SmallDisk(const std::string& size) {
    mounted_ =
        ::mount("tmpfs", directory_.path().c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  ~SmallDisk() {
    if (mounted_) {
      ::umount2(directory_.path().c_str(), MNT_DETACH);
    }
  }
  bool mounted() const { return mounted_; }
  void Resize(const std::string& size) {
    ASSERT_EQ(
        ::mount("tmpfs", directory_.path().c_str(), "tmpfs", MS_REMOUNT, ("size=" + size).c_str()),
        0);
  }
  const std::filesystem::path& root() const { return directory_.path(); }
  std::filesystem::path path() const { return directory_.path() / "maps"; }

 private:
  TemporaryDirectory directory_;
  bool mounted_ = false;
};

}  // namespace loci
