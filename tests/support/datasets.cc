// SPDX-License-Identifier: Apache-2.0
// Reading of data sets, plain, gzip or bzip2.
#include "tests/support/datasets.h"

#include <array>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>

#include <bzlib.h>
#include <zlib.h>

namespace loci {
namespace {

constexpr std::size_t kChunkBytes = 1U << 16U;

StatusOr<std::string> ReadGzip(const std::filesystem::path& path) {
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(path.c_str(), "rb"), gzclose);
  std::string content;
  std::array<char, kChunkBytes> chunk{};
  while (file != nullptr) {
    const int count = gzread(file.get(), chunk.data(), static_cast<unsigned>(chunk.size()));
    if (count == 0) {
      return content;
    }
    if (count < 0) {
      break;
    }
    content.append(chunk.data(), static_cast<std::size_t>(count));
  }
  return DataLossError(path.string() + ": not a readable gzip file");
}

StatusOr<std::string> ReadBzip2(const std::filesystem::path& path) {
  const std::unique_ptr<BZFILE, void (*)(BZFILE*)> file(BZ2_bzopen(path.c_str(), "rb"),
                                                        BZ2_bzclose);
  std::string content;
  std::array<char, kChunkBytes> chunk{};
  while (file != nullptr) {
    const int count = BZ2_bzread(file.get(), chunk.data(), static_cast<int>(chunk.size()));
    if (count == 0) {
      return content;
    }
    if (count < 0) {
      break;
    }
    content.append(chunk.data(), static_cast<std::size_t>(count));
  }
  return DataLossError(path.string() + ": not a readable bzip2 file");
}

}  // namespace

std::filesystem::path DatasetsFolder() {
  const char* folder = std::getenv("LOCI_DATASETS");
  return folder != nullptr ? std::filesystem::path(folder)
                           : std::filesystem::path(LOCI_SOURCE_FOLDER) / "../shared/datasets";
}

StatusOr<std::string> ReadDataset(std::string_view name) {
  const std::filesystem::path path = DatasetsFolder() / name;
  if (!std::filesystem::is_regular_file(path)) {
    return NotFoundError(path.string() +
                         ": no such data set; set LOCI_DATASETS to the folder of the data sets");
  }
  if (path.extension() == ".gz") {
    return ReadGzip(path);
  }
  if (path.extension() == ".bz2") {
    return ReadBzip2(path);
  }
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

}  // namespace loci
