// SPDX-License-Identifier: Apache-2.0
// A look at Protocol Buffers' bytes before they are parsed.
#include "server/rpc/wire_scan.h"

#include <cstdint>
#include <string>

namespace loci {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

enum WireType : std::uint32_t {
  kVarint = 0,
  kFixed64 = 1,
  kLengthDelimited = 2,
  kStartGroup = 3,
  kEndGroup = 4,
  kFixed32 = 5,
};

class WireScanner {
 public:
  WireScanner(std::string_view bytes, const WireLimits& limits) : bytes_(bytes), limits_(limits) {}

  // Scans the message of `type` in the bytes up to `end`.
  Status ScanMessage(const Descriptor& type, std::size_t end, std::size_t depth) {
    if (depth > limits_.depth_max) {
      return InvalidArgumentError(type.full_name() + ": messages nest deeper than " +
                                  std::to_string(limits_.depth_max));
    }
    while (position_ < end) {
      std::uint64_t tag = 0;
      if (!ReadVarint(end, tag) || tag > UINT32_MAX || (tag >> 3U) == 0) {
        return Malformed(type);
      }
      const FieldDescriptor* field = type.FindFieldByNumber(static_cast<int>(tag >> 3U));
      LOCI_RETURN_IF_ERROR(
          ScanField(type, field, static_cast<std::uint32_t>(tag & 7U), end, depth));
    }
    return {};
  }

 private:
  Status ScanField(const Descriptor& type,
                   const FieldDescriptor* field,
                   std::uint32_t wire_type,
                   std::size_t end,
                   std::size_t depth) {
    if (field == nullptr || wire_type == kLengthDelimited) {
      LOCI_RETURN_IF_ERROR(CountAllocation(type));
    }
    std::uint64_t ignored = 0;
    switch (wire_type) {
      case kVarint:
        return ReadVarint(end, ignored) ? Status() : Malformed(type);
      case kFixed64:
        return Skip(8, end) ? Status() : Malformed(type);
      case kFixed32:
        return Skip(4, end) ? Status() : Malformed(type);
      case kLengthDelimited:
        return ScanLengthDelimited(type, field, end, depth);
      default:
        // No message of ours has groups, and an unknown one could nest without end.
        return InvalidArgumentError(type.full_name() +
                                    ": has a group; only proto3 fields are read");
    }
  }

  Status ScanLengthDelimited(const Descriptor& type,
                             const FieldDescriptor* field,
                             std::size_t end,
                             std::size_t depth) {
    std::uint64_t size = 0;
    if (!ReadVarint(end, size) || size > end - position_) {
      return Malformed(type);
    }
    if (field != nullptr && field->type() == FieldDescriptor::TYPE_MESSAGE) {
      return ScanMessage(*field->message_type(), position_ + size, depth + 1);
    }
    position_ += size;
    return {};
  }

  Status CountAllocation(const Descriptor& type) {
    if (++allocations_ > limits_.allocations_max) {
      return InvalidArgumentError(type.full_name() + ": the request has more than " +
                                  std::to_string(limits_.allocations_max) +
                                  " messages, strings and unknown fields; send it in parts");
    }
    return {};
  }

  Status Malformed(const Descriptor& type) const {
    return InvalidArgumentError("the request is no " + type.full_name() + ": byte " +
                                std::to_string(position_) + " of " + std::to_string(bytes_.size()) +
                                " does not parse");
  }

  bool ReadVarint(std::size_t end, std::uint64_t& value) {
    value = 0;
    for (std::uint32_t shift = 0; shift < 70; shift += 7) {
      if (position_ >= end) {
        return false;
      }
      const auto byte = static_cast<std::uint8_t>(bytes_[position_++]);
      if (shift < 64) {
        value |= static_cast<std::uint64_t>(byte & 0x7FU) << shift;
      }
      if (byte < 0x80U) {
        return true;
      }
    }
    return false;
  }

  bool Skip(std::size_t count, std::size_t end) {
    if (count > end - position_) {
      return false;
    }
    position_ += count;
    return true;
  }

  const std::string_view bytes_;
  const WireLimits& limits_;
  std::size_t position_ = 0;
  std::size_t allocations_ = 0;
};

}  // namespace

Status CheckWire(std::string_view bytes, const Descriptor& type, const WireLimits& limits) {
  return WireScanner(bytes, limits).ScanMessage(type, bytes.size(), 1);
}

}  // namespace loci
