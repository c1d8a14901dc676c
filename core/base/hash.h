// SPDX-License-Identifier: Apache-2.0
// A 128-bit hash of a sequence of words: the state digest is made of it. Not cryptographic.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace loci {

// 128 bits; printed as 32 hexadecimal digits.
struct Digest {
  std::uint64_t high = 0;
  std::uint64_t low = 0;

  friend bool operator==(const Digest&, const Digest&) = default;
  std::string ToHex() const;
};

// Feeds words in order; the result depends on every word and on the order.
class Hasher {
 public:
  void Add(std::uint64_t word);
  // Adds the length, then the bytes.
  void AddBytes(std::span<const std::byte> bytes);
  Digest Finish() const;

 private:
  std::uint64_t high_ = 0x6C6F6369'6D617073ULL;  // "locimaps"
  std::uint64_t low_ = 0x9E3779B97F4A7C15ULL;
  std::uint64_t count_ = 0;
};

}  // namespace loci
