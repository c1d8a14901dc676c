// SPDX-License-Identifier: Apache-2.0
#include "storage/record_codec.h"

#include <array>
#include <cstddef>
#include <cstring>

#include <zstd.h>

#include "storage/crc32c.h"
#include "storage/store.h"

namespace loci {
namespace {

// Level 1 compresses grids at several hundred MB/s; higher levels gain a few per cent.
constexpr int kCompressionLevel = 1;
// Shorter records do not get smaller.
constexpr std::size_t kCompressedSizeMin = 64;

template <std::size_t count>
std::uint32_t ChecksumOf(const std::array<std::uint64_t, count>& numbers, std::string_view bytes) {
  std::array<char, count * sizeof(std::uint64_t)> prefix = {};
  std::memcpy(prefix.data(), numbers.data(), prefix.size());
  return Crc32c(bytes, Crc32c({prefix.data(), prefix.size()}));
}

std::uint32_t ChecksumOf(const StoredRecord& stored) {
  return ChecksumOf(
      std::array<std::uint64_t, 4>{
          stored.kind, stored.id, stored.valid_from.value, stored.size_bytes},
      stored.bytes);
}

// Empty if it does not pay.
std::string Compress(const std::string& bytes) {
  if (bytes.size() < kCompressedSizeMin) {
    return {};
  }
  std::string compressed(bytes.size() - 1, '\0');
  const std::size_t size = ZSTD_compress(
      compressed.data(), compressed.size(), bytes.data(), bytes.size(), kCompressionLevel);
  if (ZSTD_isError(size) != 0) {
    return {};  // it does not fit: not smaller
  }
  compressed.resize(size);
  compressed.shrink_to_fit();
  return compressed;
}

}  // namespace

std::uint32_t LogEntryChecksum(EventNumber number,
                               std::uint64_t end_bytes,
                               std::string_view bytes) {
  return ChecksumOf(std::array<std::uint64_t, 2>{number.value, end_bytes}, bytes);
}

StoredRecord EncodeRecord(const StateRecord& record, EventNumber valid_from) {
  StoredRecord stored;
  stored.kind = record.kind;
  stored.id = record.id;
  stored.valid_from = valid_from;
  stored.size_bytes = record.bytes.size();
  stored.bytes = Compress(record.bytes);
  if (stored.bytes.empty()) {
    stored.bytes = record.bytes;
  }
  stored.checksum = ChecksumOf(stored);
  return stored;
}

StatusOr<StateRecord> DecodeRecord(const StoredRecord& stored) {
  const std::uint32_t checksum = ChecksumOf(stored);
  if (checksum != stored.checksum) {
    return DataLossError("checksum " + std::to_string(stored.checksum) + ", its bytes have " +
                         std::to_string(checksum));
  }
  StateRecord record{.kind = stored.kind, .id = stored.id, .bytes = {}};
  if (stored.bytes.size() == stored.size_bytes) {
    record.bytes = stored.bytes;
    return record;
  }
  if (stored.size_bytes > kRecordSizeMax) {
    return DataLossError("size " + std::to_string(stored.size_bytes) + ", must be at most " +
                         std::to_string(kRecordSizeMax));
  }
  record.bytes.resize(stored.size_bytes);
  const std::size_t size = ZSTD_decompress(
      record.bytes.data(), record.bytes.size(), stored.bytes.data(), stored.bytes.size());
  if (ZSTD_isError(size) != 0 || size != stored.size_bytes) {
    return DataLossError("its compressed bytes do not give " + std::to_string(stored.size_bytes) +
                         " bytes");
  }
  return record;
}

}  // namespace loci
