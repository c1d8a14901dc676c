// SPDX-License-Identifier: Apache-2.0
// CRC-32C (Castagnoli): the checksum of everything that is stored.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace loci {

// The checksum of `bytes` after bytes whose checksum is `before` (0: none).
//
// Law: Crc32c(a + b) == Crc32c(b, Crc32c(a)).
// Uses the processor's instruction where it has one, else tables; both give the same.
std::uint32_t Crc32c(std::string_view bytes, std::uint32_t before = 0);

namespace internal {

// The two ways, for tests. `bytes` as above.
std::uint32_t Crc32cByTable(std::string_view bytes, std::uint32_t before);
// Must not be called where HasCrc32cInstruction() is false.
std::uint32_t Crc32cByInstruction(std::string_view bytes, std::uint32_t before);
bool HasCrc32cInstruction();

}  // namespace internal

}  // namespace loci
