// SPDX-License-Identifier: Apache-2.0
#include "core/base/archive.h"

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

enum class Color : std::uint8_t { kRed = 0, kBlue = 7 };

struct Leaf {
  std::int16_t number = 0;
  std::string text;
  friend bool operator==(const Leaf&, const Leaf&) = default;
};

template <typename Archive>
void Fields(Archive& archive, Leaf& leaf) {
  archive(leaf.number, leaf.text);
}

struct Tree {
  bool flag = false;
  double real = 0.0;
  Color color = Color::kRed;
  PlaceId place;
  std::vector<std::uint16_t> numbers;
  std::vector<Leaf> leaves;
  std::optional<Leaf> maybe;
  std::array<float, 3> fixed = {};
  friend bool operator==(const Tree&, const Tree&) = default;
};

template <typename Archive>
void Fields(Archive& archive, Tree& tree) {
  archive(tree.flag, tree.real, tree.color, tree.place);
  archive(tree.numbers, tree.leaves, tree.maybe, tree.fixed);
}

Tree FullTree() {
  return {.flag = true,
          .real = -1.5e300,
          .color = Color::kBlue,
          .place = PlaceId{77},
          .numbers = {1, 2, 65535},
          .leaves = {{-3, "three"}, {0, ""}, {9, std::string("a\0b", 3)}},
          .maybe = Leaf{4, "four"},
          .fixed = {1.0F, -2.0F, 0.25F}};
}

std::string BytesOf(const Tree& tree) {
  BinaryWriter writer;
  writer(tree);
  return writer.TakeBytes();
}

Status Read(std::string_view bytes, Tree& tree) {
  BinaryReader reader(bytes);
  reader(tree);
  return reader.Finish("tree");
}

TEST(ArchiveTest, WhatWasWrittenIsRead) {
  for (const Tree& tree : {Tree(), FullTree()}) {
    Tree read;
    read.leaves.resize(5);  // what was there before does not shine through
    read.maybe = Leaf{1, "x"};
    EXPECT_THAT(Read(BytesOf(tree), read), IsOk());
    EXPECT_EQ(read, tree);
  }
}

TEST(ArchiveTest, NumbersAreLittleEndianAndLengthsHaveEightBytes) {
  BinaryWriter writer;
  writer(std::uint32_t{0x01020304}, std::vector<std::uint8_t>{9}, std::string("z"), true);
  const std::string expected(
      "\4\3\2\1"
      "\1\0\0\0\0\0\0\0\x9"
      "\1\0\0\0\0\0\0\0z"
      "\1",
      23);
  EXPECT_EQ(writer.bytes(), expected);
}

TEST(ArchiveTest, EveryTruncationIsDataLoss) {
  const std::string bytes = BytesOf(FullTree());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    Tree tree;
    EXPECT_THAT(Read(std::string_view(bytes).substr(0, size), tree),
                IsStatus(StatusCode::kDataLoss, "tree: bytes are missing"))
        << size;
  }
}

TEST(ArchiveTest, LeftoverBytesAreDataLoss) {
  Tree tree;
  EXPECT_THAT(Read(BytesOf(FullTree()) + "xy", tree),
              IsStatus(StatusCode::kDataLoss, "tree: 2 bytes are left over"));
}

TEST(ArchiveTest, AbsurdCountsAllocateNothing) {
  for (const std::uint64_t count : {std::uint64_t{9},
                                    std::uint64_t{1} << 32U,
                                    std::uint64_t{1} << 63U,
                                    std::numeric_limits<std::uint64_t>::max()}) {
    BinaryWriter writer;
    writer(count, std::uint64_t{0});  // eight bytes follow the count
    std::vector<std::uint8_t> bytes = {1};
    BinaryReader number_reader(writer.bytes());
    number_reader(bytes);
    EXPECT_TRUE(bytes.empty());
    EXPECT_THAT(number_reader.Finish("x"), IsStatus(StatusCode::kDataLoss));
    std::vector<Leaf> leaves(1);
    BinaryReader leaf_reader(writer.bytes());
    leaf_reader(leaves);
    EXPECT_TRUE(leaves.empty());
    std::string text = "y";
    BinaryReader text_reader(writer.bytes());
    text_reader(text);
    EXPECT_TRUE(text.empty());
  }
  // Two eight-byte numbers do not fit into eight bytes, though two bytes would.
  BinaryWriter writer;
  writer(std::uint64_t{2}, std::uint64_t{0});
  std::vector<std::uint64_t> words;
  BinaryReader reader(writer.bytes());
  reader(words);
  EXPECT_TRUE(words.empty());
}

TEST(ArchiveTest, BytesThatAreNeitherTrueNorFalseAreDataLoss) {
  const std::string two("\2", 1);
  bool flag = false;
  BinaryReader reader(two);
  reader(flag);
  EXPECT_THAT(reader.Finish("flag"), IsStatus(StatusCode::kDataLoss));
  std::optional<std::uint8_t> maybe;
  BinaryReader optional_reader(two);
  optional_reader(maybe);
  EXPECT_FALSE(maybe.has_value());
  EXPECT_THAT(optional_reader.Finish("maybe"), IsStatus(StatusCode::kDataLoss));
}

TEST(ArchiveTest, RandomDamageNeverCrashesAReader) {
  const std::string bytes = BytesOf(FullTree());
  RandomSequence random(1);
  for (int round = 0; round < 5000; ++round) {
    std::string damaged = bytes;
    const std::uint64_t flips = 1 + random.NextBits() % 4;
    for (std::uint64_t i = 0; i < flips; ++i) {
      damaged[random.NextBits() % damaged.size()] ^=
          static_cast<char>(1U << (random.NextBits() % 8U));
    }
    Tree tree;
    const Status status = Read(damaged, tree);
    EXPECT_TRUE(status.ok() || status.code() == StatusCode::kDataLoss);
  }
}

TEST(ArchiveTest, AReaderThatFailedGivesZerosForEver) {
  BinaryReader reader("abc");
  std::uint64_t number = 5;
  reader(number);
  EXPECT_EQ(number, 0U);
  std::uint8_t byte = 5;
  reader(byte);  // the bytes are there, but they mean nothing any more
  EXPECT_EQ(byte, 0U);
  EXPECT_THAT(reader.Finish("x"), IsStatus(StatusCode::kDataLoss));
}

TEST(ArchiveTest, TheHashOfFieldsTellsEveryFieldApart) {
  const auto digest = [](const Tree& tree) {
    HashArchive archive;
    archive(tree);
    return archive.Finish();
  };
  const Tree tree = FullTree();
  EXPECT_EQ(digest(tree), digest(FullTree()));
  std::vector<Tree> others(8, tree);
  others[0].flag = false;
  others[1].real = std::nextafter(tree.real, 0.0);
  others[2].color = Color::kRed;
  others[3].place.value = 78;
  others[4].numbers.push_back(0);
  std::swap(others[5].leaves[0], others[5].leaves[1]);
  others[6].maybe.reset();
  others[7].fixed[2] = -0.25F;
  for (const Tree& other : others) {
    EXPECT_NE(digest(other), digest(tree));
  }
}

}  // namespace
}  // namespace loci
