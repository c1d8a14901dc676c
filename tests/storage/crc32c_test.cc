// SPDX-License-Identifier: Apache-2.0
#include "storage/crc32c.h"

#include <cstddef>
#include <string>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

std::string RandomBytes(std::size_t size, RandomSequence& random) {
  std::string bytes(size, '\0');
  for (char& byte : bytes) {
    byte = static_cast<char>(random.NextBits());
  }
  return bytes;
}

// RFC 3720, appendix B.4.
TEST(Crc32cTest, GivesThePublishedValues) {
  std::string ascending;
  for (int i = 0; i < 32; ++i) {
    ascending += static_cast<char>(i);
  }
  EXPECT_EQ(Crc32c(std::string(32, '\0')), 0x8A9136AAU);
  EXPECT_EQ(Crc32c(std::string(32, '\xFF')), 0x62A8AB43U);
  EXPECT_EQ(Crc32c(ascending), 0x46DD794EU);
  EXPECT_EQ(Crc32c("123456789"), 0xE3069283U);
  EXPECT_EQ(Crc32c(""), 0U);
}

TEST(Crc32cTest, InstructionAndTablesAgreeAtEveryLengthAndAlignment) {
  if (!internal::HasCrc32cInstruction()) {
    GTEST_SKIP() << "this processor has no such instruction";
  }
  RandomSequence random(1);
  const std::string bytes = RandomBytes(300, random);
  for (std::size_t begin = 0; begin < 9; ++begin) {
    for (std::size_t size = 0; begin + size <= bytes.size(); ++size) {
      const std::string_view part = std::string_view(bytes).substr(begin, size);
      ASSERT_EQ(internal::Crc32cByInstruction(part, 7), internal::Crc32cByTable(part, 7));
    }
  }
}

TEST(Crc32cTest, APartGoesOnFromThePartBefore) {
  RandomSequence random(2);
  const std::string bytes = RandomBytes(100, random);
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    EXPECT_EQ(Crc32c(bytes.substr(cut), Crc32c(bytes.substr(0, cut))), Crc32c(bytes));
  }
}

TEST(Crc32cTest, EveryFlippedBitChangesIt) {
  RandomSequence random(3);
  std::string bytes = RandomBytes(64, random);
  const std::uint32_t right = Crc32c(bytes);
  for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
    EXPECT_NE(Crc32c(bytes), right);
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
  }
}

}  // namespace
}  // namespace loci
