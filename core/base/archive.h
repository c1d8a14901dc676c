// SPDX-License-Identifier: Apache-2.0
// Little-endian bytes for events and state: one description of a type's fields serves for writing,
// for reading and for the state digest.
//
// A type T takes part by a function found beside it:
//   template <typename Archive> void Fields(Archive& archive, T& value) { archive(value.a,
//   value.b); }
// Fields are visited in order. Numbers have a fixed size; vectors and strings carry their length.
#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/base/hash.h"
#include "core/base/ids.h"
#include "core/base/status.h"

namespace loci {

static_assert(std::endian::native == std::endian::little, "stored bytes are little-endian");

// Collects bytes.
class BinaryWriter {
 public:
  static constexpr bool kReads = false;

  void Raw(const void* data, std::size_t size_bytes) {
    bytes_.append(static_cast<const char*>(data), size_bytes);
  }
  template <typename... Ts>
  void operator()(const Ts&... values);

  const std::string& bytes() const { return bytes_; }
  std::string TakeBytes() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

// Reads what BinaryWriter wrote. Bytes from a disk may be damaged: a read past the end or a length
// that cannot be makes the reader fail, once and for good; values read after that are zero.
class BinaryReader {
 public:
  static constexpr bool kReads = true;

  explicit BinaryReader(std::string_view bytes) : rest_(bytes) {}

  void Raw(void* data, std::size_t size_bytes);
  template <typename... Ts>
  void operator()(Ts&... values);

  // A length read from the bytes, of elements of at least `element_size_bytes` each; 0 after
  // failure.
  std::size_t ReadCount(std::size_t element_size_bytes);
  void Fail() { failed_ = true; }
  bool failed() const { return failed_; }
  // OK if everything was read, nothing was missing and nothing is left over.
  Status Finish(std::string_view what) const;

 private:
  std::string_view rest_;
  bool failed_ = false;
};

// Feeds the fields to a hash.
class HashArchive {
 public:
  static constexpr bool kReads = false;

  void Raw(const void* data, std::size_t size_bytes) {
    hasher_.AddBytes({static_cast<const std::byte*>(data), size_bytes});
  }
  template <typename... Ts>
  void operator()(const Ts&... values);
  Digest Finish() const { return hasher_.Finish(); }

 private:
  Hasher hasher_;
};

namespace internal {

template <typename T>
concept Number = std::is_arithmetic_v<T> || std::is_enum_v<T>;

template <typename Archive, typename T>
void Visit(Archive& archive, T& value);

template <typename Archive, typename Element, typename Allocator>
void VisitVector(Archive& archive, std::vector<Element, Allocator>& values) {
  if constexpr (Archive::kReads) {
    values.resize(archive.ReadCount(Number<Element> ? sizeof(Element) : 1));
  } else {
    const std::uint64_t count = values.size();
    archive.Raw(&count, sizeof(count));
  }
  if constexpr (Number<Element>) {
    if (!values.empty()) {
      archive.Raw(values.data(), values.size() * sizeof(Element));
    }
  } else {
    for (Element& element : values) {
      Visit(archive, element);
    }
  }
}

template <typename T>
struct IsVector : std::false_type {};
template <typename E, typename A>
struct IsVector<std::vector<E, A>> : std::true_type {};
template <typename T>
struct IsOptional : std::false_type {};
template <typename E>
struct IsOptional<std::optional<E>> : std::true_type {};
template <typename T>
struct IsArray : std::false_type {};
template <typename E, std::size_t N>
struct IsArray<std::array<E, N>> : std::true_type {};
template <typename T>
struct IsId : std::false_type {};
template <typename Tag, typename I>
struct IsId<Id<Tag, I>> : std::true_type {};

template <typename Archive, typename T>
void VisitOptional(Archive& archive, T& value) {
  std::uint8_t present = value.has_value() ? 1 : 0;
  archive.Raw(&present, 1);
  if constexpr (Archive::kReads) {
    if (present > 1) {
      archive.Fail();
    }
    value.reset();
    if (present == 1) {
      value.emplace();
    }
  }
  if (value.has_value()) {
    Visit(archive, *value);
  }
}

template <typename Archive>
void VisitString(Archive& archive, std::string& text) {
  if constexpr (Archive::kReads) {
    text.resize(archive.ReadCount(1));
  } else {
    const std::uint64_t count = text.size();
    archive.Raw(&count, sizeof(count));
  }
  archive.Raw(text.data(), text.size());
}

template <typename Archive>
void VisitBool(Archive& archive, bool& value) {
  std::uint8_t byte = value ? 1 : 0;
  archive.Raw(&byte, 1);
  if constexpr (Archive::kReads) {
    if (byte > 1) {
      archive.Fail();
    }
    value = byte == 1;
  }
}

template <typename Archive, typename T>
void Visit(Archive& archive, T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    VisitBool(archive, value);
  } else if constexpr (Number<T>) {
    archive.Raw(&value, sizeof(value));
  } else if constexpr (IsId<T>::value) {
    archive.Raw(&value.value, sizeof(value.value));
  } else if constexpr (std::is_same_v<T, std::string>) {
    VisitString(archive, value);
  } else if constexpr (IsVector<T>::value) {
    VisitVector(archive, value);
  } else if constexpr (IsOptional<T>::value) {
    VisitOptional(archive, value);
  } else if constexpr (IsArray<T>::value) {
    for (auto& element : value) {
      Visit(archive, element);
    }
  } else {
    Fields(archive, value);  // found by argument-dependent lookup
  }
}

}  // namespace internal

template <typename... Ts>
void BinaryWriter::operator()(const Ts&... values) {
  // Fields() takes T& so that one description serves both ways; a writer never changes the value.
  (internal::Visit(*this, const_cast<Ts&>(values)), ...);
}

template <typename... Ts>
void BinaryReader::operator()(Ts&... values) {
  (internal::Visit(*this, values), ...);
}

template <typename... Ts>
void HashArchive::operator()(const Ts&... values) {
  (internal::Visit(*this, const_cast<Ts&>(values)), ...);
}

}  // namespace loci
