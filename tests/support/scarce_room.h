// SPDX-License-Identifier: Apache-2.0
// Room for a server's maps that runs out when a test says so, and comes back.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include "tests/support/server_process.h"
#include "tests/support/temporary_directory.h"

namespace loci {

// What there is too little of.
enum class Shortage : std::uint8_t {
  kFileSystem,  // a small one of its own, filled up; needs the right to mount
  kFileSize,    // how large the server's files may become; works everywhere
};

inline std::string ShortageName(const ::testing::TestParamInfo<Shortage>& shortage) {
  return shortage.param == Shortage::kFileSystem ? "FileSystem" : "FileSize";
}

class ScarceRoom {
 public:
  explicit ScarceRoom(Shortage shortage) : shortage_(shortage) {
    mounted_ = shortage == Shortage::kFileSystem &&
               ::mount("tmpfs", directory_.path().c_str(), "tmpfs", 0, "size=16m") == 0;
  }
  ScarceRoom(const ScarceRoom&) = delete;
  ScarceRoom& operator=(const ScarceRoom&) = delete;
  ~ScarceRoom() {
    if (mounted_) {
      ::umount2(directory_.path().c_str(), MNT_DETACH);
    }
  }

  // False where mounting is not allowed.
  bool possible() const { return mounted_ || shortage_ == Shortage::kFileSize; }
  std::filesystem::path maps() const { return directory_.path() / "maps"; }

  // From now on there is room for about `left_bytes`: of all files, or of each.
  void RunOut(const ServerProcess& server, std::uintmax_t left_bytes) {
    if (shortage_ == Shortage::kFileSystem) {
      Fill(left_bytes);
      return;
    }
    std::uintmax_t largest = 0;
    for (const auto& entry : std::filesystem::directory_iterator(maps())) {
      largest = std::max(largest, entry.file_size());
    }
    SetFileSizeMax(server, largest + left_bytes);
  }
  void ComeBack(const ServerProcess& server) {
    if (shortage_ == Shortage::kFileSystem) {
      EXPECT_TRUE(std::filesystem::remove(ballast()));
    } else {
      SetFileSizeMax(server, RLIM_INFINITY);
    }
  }

 private:
  std::filesystem::path ballast() const { return directory_.path() / "ballast"; }
  void Fill(std::uintmax_t left_bytes) {
    std::ofstream file(ballast(), std::ios::binary | std::ios::app);
    const std::string piece(4096, 'x');
    while (std::filesystem::space(ballast()).available > left_bytes + piece.size()) {
      file << piece << std::flush;
      ASSERT_TRUE(file.good());
    }
  }
  // The soft limit: anyone may raise that of his own process again, up to the hard one.
  static void SetFileSizeMax(const ServerProcess& server, rlim_t size_max) {
    rlimit limit{};
    ASSERT_EQ(::prlimit(server.pid(), RLIMIT_FSIZE, nullptr, &limit), 0);
    limit.rlim_cur = std::min(size_max, limit.rlim_max);
    ASSERT_EQ(::prlimit(server.pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
  }

  const Shortage shortage_;
  const TemporaryDirectory directory_;
  bool mounted_ = false;
};

}  // namespace loci
