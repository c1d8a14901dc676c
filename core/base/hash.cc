// SPDX-License-Identifier: Apache-2.0
#include "core/base/hash.h"

#include <array>
#include <cstring>

namespace loci {
namespace {

// 64 x 64 -> 128 bit product, folded: one multiplication mixes every bit (as in wyhash).
std::uint64_t FoldedProduct(std::uint64_t a, std::uint64_t b) {
  __extension__ using Wide = unsigned __int128;
  const Wide product = static_cast<Wide>(a) * b;
  return static_cast<std::uint64_t>(product) ^ static_cast<std::uint64_t>(product >> 64U);
}

}  // namespace

void Hasher::Add(std::uint64_t word) {
  ++count_;
  high_ = FoldedProduct(high_ ^ word, 0xA0761D6478BD642FULL ^ (low_ + count_));
  low_ = FoldedProduct(low_ + (word ^ 0xE7037ED1A0B428DBULL), 0x8EBC6AF09C88C6E3ULL ^ high_);
}

void Hasher::AddBytes(std::span<const std::byte> bytes) {
  Add(bytes.size());
  while (!bytes.empty()) {
    std::uint64_t word = 0;
    const std::size_t size = bytes.size() < sizeof(word) ? bytes.size() : sizeof(word);
    std::memcpy(&word, bytes.data(), size);
    Add(word);
    bytes = bytes.subspan(size);
  }
}

Digest Hasher::Finish() const {
  Hasher last = *this;
  last.Add(count_);
  last.Add(0x589965CC75374CC3ULL);
  return {last.high_, last.low_};
}

std::string Digest::ToHex() const {
  static constexpr std::array<char, 17> kDigits = {"0123456789abcdef"};
  std::string text;
  for (const std::uint64_t word : {high, low}) {
    for (int shift = 60; shift >= 0; shift -= 4) {
      text += kDigits[(word >> static_cast<unsigned>(shift)) & 15U];
    }
  }
  return text;
}

}  // namespace loci
