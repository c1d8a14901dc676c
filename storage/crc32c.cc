// SPDX-License-Identifier: Apache-2.0
#include "storage/crc32c.h"

#include <array>
#include <cstring>

#if defined(__x86_64__)
#include <nmmintrin.h>
#endif

namespace loci {
namespace {

// Castagnoli's polynomial 0x1EDC6F41, bits reversed (RFC 3720, appendix B.4).
constexpr std::uint32_t kPolynomial = 0x82F63B78U;

using Tables = std::array<std::array<std::uint32_t, 256>, 8>;

// tables[k][b]: what the byte b changes k bytes later, so that 8 bytes are taken in one step
// ("slicing by 8", Kounavis and Berry 2005).
constexpr Tables MakeTables() {
  Tables tables = {};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc >> 1U) ^ ((crc & 1U) != 0U ? kPolynomial : 0U);
    }
    tables[0][byte] = crc;
  }
  for (std::size_t k = 1; k < tables.size(); ++k) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint32_t crc = tables[k - 1][byte];
      tables[k][byte] = (crc >> 8U) ^ tables[0][crc & 0xFFU];
    }
  }
  return tables;
}

constexpr Tables kTables = MakeTables();

std::uint64_t WordAt(const char* data) {
  std::uint64_t word = 0;
  std::memcpy(&word, data, sizeof(word));
  return word;
}

}  // namespace

namespace internal {

std::uint32_t Crc32cByTable(std::string_view bytes, std::uint32_t before) {
  std::uint32_t crc = ~before;
  while (bytes.size() >= 8) {
    const std::uint64_t word = WordAt(bytes.data()) ^ crc;
    crc = 0;
    for (unsigned i = 0; i < 8; ++i) {
      crc ^= kTables[7 - i][(word >> (8 * i)) & 0xFFU];
    }
    bytes.remove_prefix(8);
  }
  for (const char byte : bytes) {
    crc = (crc >> 8U) ^ kTables[0][(crc ^ static_cast<unsigned char>(byte)) & 0xFFU];
  }
  return ~crc;
}

#if defined(__x86_64__)

__attribute__((target("sse4.2"))) std::uint32_t Crc32cByInstruction(std::string_view bytes,
                                                                    std::uint32_t before) {
  std::uint64_t crc = ~before;
  while (bytes.size() >= 8) {
    crc = _mm_crc32_u64(crc, WordAt(bytes.data()));
    bytes.remove_prefix(8);
  }
  auto last = static_cast<std::uint32_t>(crc);
  for (const char byte : bytes) {
    last = _mm_crc32_u8(last, static_cast<unsigned char>(byte));
  }
  return ~last;
}

bool HasCrc32cInstruction() {
  return __builtin_cpu_supports("sse4.2") != 0;
}

#else

std::uint32_t Crc32cByInstruction(std::string_view bytes, std::uint32_t before) {
  return Crc32cByTable(bytes, before);
}

bool HasCrc32cInstruction() {
  return false;
}

#endif

}  // namespace internal

std::uint32_t Crc32c(std::string_view bytes, std::uint32_t before) {
  static const bool has_instruction = internal::HasCrc32cInstruction();
  return has_instruction ? internal::Crc32cByInstruction(bytes, before)
                         : internal::Crc32cByTable(bytes, before);
}

}  // namespace loci
