// SPDX-License-Identifier: Apache-2.0
#include "core/base/hash.h"

#include <bit>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace loci {
namespace {

Digest HashOf(const std::vector<std::uint64_t>& words) {
  Hasher hasher;
  for (const std::uint64_t word : words) {
    hasher.Add(word);
  }
  return hasher.Finish();
}

Digest HashOfText(const std::string& text) {
  Hasher hasher;
  hasher.AddBytes(std::as_bytes(std::span(text)));
  return hasher.Finish();
}

TEST(HashTest, DependsOnTheWordsOnly) {
  EXPECT_EQ(HashOf({1, 2, 3}), HashOf({1, 2, 3}));
  EXPECT_EQ(HashOfText(std::string("abc")), HashOfText(std::string("abc")));
}

TEST(HashTest, DependsOnOrderAndCount) {
  EXPECT_NE(HashOf({1, 2}), HashOf({2, 1}));
  EXPECT_NE(HashOf({}), HashOf({0}));
  EXPECT_NE(HashOf({0}), HashOf({0, 0}));
  EXPECT_NE(HashOfText(std::string("a")), HashOfText(std::string("a\0", 2)));
}

TEST(HashTest, BytesOfTwoStringsDoNotRunTogether) {
  const auto hash = [](const std::string& first, const std::string& second) {
    Hasher hasher;
    hasher.AddBytes(std::as_bytes(std::span(first)));
    hasher.AddBytes(std::as_bytes(std::span(second)));
    return hasher.Finish();
  };
  EXPECT_NE(hash("ab", "c"), hash("a", "bc"));
}

TEST(HashTest, FlippingAnyOneBitChangesAboutHalfOfTheDigest) {
  RandomSequence random(7);
  std::vector<std::uint64_t> words;
  for (int i = 0; i < 8; ++i) {
    words.push_back(random.NextBits());
  }
  const Digest before = HashOf(words);
  int changed_bits = 0;
  for (std::size_t word = 0; word < words.size(); ++word) {
    for (unsigned bit = 0; bit < 64; ++bit) {
      words[word] ^= std::uint64_t{1} << bit;
      const Digest after = HashOf(words);
      words[word] ^= std::uint64_t{1} << bit;
      const int changed =
          std::popcount(after.high ^ before.high) + std::popcount(after.low ^ before.low);
      EXPECT_GT(changed, 30) << word << " " << bit;
      changed_bits += changed;
    }
  }
  EXPECT_NEAR(changed_bits / 512.0, 64.0, 2.0);
}

TEST(HashTest, SmallSequencesDoNotCollide) {
  std::set<std::string> seen;
  for (std::uint64_t a = 0; a < 64; ++a) {
    for (std::uint64_t b = 0; b < 64; ++b) {
      seen.insert(HashOf({a, b}).ToHex());
    }
  }
  EXPECT_EQ(seen.size(), 64U * 64U);
}

TEST(HashTest, HexHasThirtyTwoDigitsAndKeepsLeadingZeros) {
  EXPECT_EQ((Digest{0x1, 0xABCDEF0123456789ULL}).ToHex(), "0000000000000001abcdef0123456789");
}

}  // namespace
}  // namespace loci
