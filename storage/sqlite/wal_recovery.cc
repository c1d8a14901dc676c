// SPDX-License-Identifier: Apache-2.0
// The format of the log is SQLite's: https://www.sqlite.org/fileformat2.html, section 4.
#include "storage/sqlite/wal_recovery.h"

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include "storage/sqlite/connection.h"
#include "storage/sqlite/file_system.h"

namespace loci {
namespace {

constexpr std::size_t kHeaderSize = 32;
constexpr std::size_t kFrameHeaderSize = 24;
constexpr std::uint32_t kMagic = 0x377F0682;  // the last bit: checksums over big-endian words

std::uint32_t BigEndianAt(const char* data) {
  std::array<unsigned char, 4> bytes = {};
  std::memcpy(bytes.data(), data, bytes.size());
  return static_cast<std::uint32_t>(bytes[0]) << 24U | static_cast<std::uint32_t>(bytes[1]) << 16U |
         static_cast<std::uint32_t>(bytes[2]) << 8U | static_cast<std::uint32_t>(bytes[3]);
}

std::uint32_t LittleEndianAt(const char* data) {
  return __builtin_bswap32(BigEndianAt(data));
}

struct Checksum {
  std::uint32_t s0 = 0;
  std::uint32_t s1 = 0;
  friend bool operator==(const Checksum&, const Checksum&) = default;
};

Checksum StoredAt(const char* data) {
  return {BigEndianAt(data), BigEndianAt(data + 4)};
}

Checksum Continue(Checksum sum, const char* data, std::size_t size, bool big_endian) {
  for (std::size_t i = 0; i + 8 <= size; i += 8) {
    const char* at = data + i;
    sum.s0 += (big_endian ? BigEndianAt(at) : LittleEndianAt(at)) + sum.s1;
    sum.s1 += (big_endian ? BigEndianAt(at + 4) : LittleEndianAt(at + 4)) + sum.s0;
  }
  return sum;
}

struct Header {
  bool big_endian = false;
  std::uint32_t page_size = 0;
  std::array<char, 8> salts = {};
  Checksum checksum;
};

// False if it is not a header, or its checksum is wrong.
bool ReadHeader(std::ifstream& in, Header& header) {
  std::array<char, kHeaderSize> bytes = {};
  if (!in.read(bytes.data(), bytes.size())) {
    return false;
  }
  header.big_endian = (BigEndianAt(bytes.data()) & 1U) != 0;
  header.page_size = BigEndianAt(bytes.data() + 8);
  std::memcpy(header.salts.data(), bytes.data() + 16, header.salts.size());
  header.checksum = Continue({}, bytes.data(), 24, header.big_endian);
  const std::uint32_t size = header.page_size;
  return (BigEndianAt(bytes.data()) & ~1U) == kMagic && size >= 512 && size <= 65536 &&
         (size & (size - 1)) == 0 && header.checksum == StoredAt(bytes.data() + 24);
}

// Number of the first frame that is not whole if later frames prove that it was; 0 for none.
std::uint64_t FindDamagedFrame(std::ifstream& in, const Header& header) {
  std::vector<char> frame(kFrameHeaderSize + header.page_size);
  Checksum computed = header.checksum;  // what the next frame goes on from, by the bytes before it
  Checksum stored = header.checksum;    // the same, by what the frame before it says
  std::uint64_t first_bad = 0;
  bool after_commit = false;
  for (std::uint64_t number = 1; in.read(frame.data(), static_cast<std::streamsize>(frame.size()));
       ++number) {
    const char* page = frame.data() + kFrameHeaderSize;
    const auto sum_from = [&](Checksum sum) {
      sum = Continue(sum, frame.data(), 8, header.big_endian);
      return Continue(sum, page, header.page_size, header.big_endian);
    };
    const Checksum own = StoredAt(frame.data() + 16);
    const Checksum from_computed = sum_from(computed);
    const bool same_log = std::memcmp(frame.data() + 8, header.salts.data(), 8) == 0;
    const bool follows = same_log && (from_computed == own || sum_from(stored) == own);
    if (first_bad == 0 && !(same_log && from_computed == own)) {
      first_bad = number;
    } else if (first_bad != 0 && follows && after_commit) {
      return first_bad;
    }
    after_commit = first_bad != 0 && BigEndianAt(frame.data() + 4) != 0;
    computed = from_computed;
    stored = own;
  }
  return 0;
}

Status CheckFrames(const std::filesystem::path& wal) {
  std::ifstream in(wal, std::ios::binary);
  const std::string name = wal.filename().string();
  Header header;
  if (!ReadHeader(in, header)) {
    // SQLite makes the header durable before it writes a frame.
    return FileSizeBytes(wal) > kHeaderSize + kFrameHeaderSize
               ? DamagedFileError(name, "the header of the write-ahead log is wrong")
               : Status();
  }
  const std::uint64_t damaged = FindDamagedFrame(in, header);
  if (damaged != 0) {
    return DamagedFileError(name,
                            "frame " + std::to_string(damaged) + " of the write-ahead log is " +
                                "wrong, and transactions follow it");
  }
  return {};
}

Status CopyBytes(const std::filesystem::path& from, const std::filesystem::path& to) {
  LOCI_ASSIGN_OR_RETURN(const FileDescriptor in, FileDescriptor::Open(from, O_RDONLY));
  LOCI_ASSIGN_OR_RETURN(const FileDescriptor out,
                        FileDescriptor::Open(to, O_WRONLY | O_CREAT | O_TRUNC));
  std::vector<char> buffer(1U << 20U);
  for (;;) {
    const ssize_t size = ::read(in.value(), buffer.data(), buffer.size());
    if (size < 0) {
      return SystemFailure(errno, "reading " + from.string());
    }
    if (size == 0) {
      return Sync(out, to);
    }
    for (ssize_t done = 0; done < size;) {
      const ssize_t written =
          ::write(out.value(), buffer.data() + done, static_cast<std::size_t>(size - done));
      if (written < 0) {
        return SystemFailure(errno, "writing " + to.string());
      }
      done += written;
    }
  }
}

Status MakeDurable(const std::filesystem::path& wal) {
  const std::filesystem::path copy = std::filesystem::path(wal) += ".new";
  const Status copied = CopyBytes(wal, copy);
  if (copied.ok()) {
    LOCI_RETURN_IF_ERROR(RenameFile(copy, wal));
    return SyncDirectory(wal.parent_path());
  }
  IgnoreError(RemoveFile(copy), "the first error says what happened");
  if (copied.code() != StatusCode::kResourceExhausted) {
    return copied;
  }
  // A full disk must not keep a map from being opened and read.
  LOCI_ASSIGN_OR_RETURN(const FileDescriptor file, FileDescriptor::Open(wal, O_RDWR));
  return Sync(file, wal);
}

}  // namespace

Status PrepareWal(const std::filesystem::path& wal) {
  if (FileSizeBytes(wal) == 0) {
    return {};
  }
  LOCI_RETURN_IF_ERROR(CheckFrames(wal));
  return MakeDurable(wal);
}

}  // namespace loci
