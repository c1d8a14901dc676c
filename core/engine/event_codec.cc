// SPDX-License-Identifier: Apache-2.0
// The bytes of events in the log: a version, the alternative's index, the fields.
#include <cstddef>
#include <utility>

#include "core/engine/event.h"

namespace loci {
namespace {

// Of the bytes that follow it. A change of any event's fields needs a new number and a reader for
// the old one, because logs outlive programs.
constexpr std::uint8_t kEventVersion = 1;

template <std::size_t index>
bool ReadAlternative(BinaryReader& reader, std::size_t wanted, Event& event) {
  if (wanted != index) {
    return false;
  }
  reader(event.emplace<index>());
  return true;
}

template <std::size_t... indices>
bool ReadFields(BinaryReader& reader,
                std::size_t wanted,
                Event& event,
                std::index_sequence<indices...> /*all*/) {
  return (ReadAlternative<indices>(reader, wanted, event) || ...);
}

}  // namespace

std::string EncodeEvent(const Event& event) {
  BinaryWriter writer;
  writer(kEventVersion, static_cast<std::uint8_t>(event.index()));
  std::visit([&writer](const auto& alternative) { writer(alternative); }, event);
  return writer.TakeBytes();
}

StatusOr<Event> DecodeEvent(std::string_view bytes) {
  BinaryReader reader(bytes);
  std::uint8_t version = 0;
  std::uint8_t index = 0;
  reader(version, index);
  if (bytes.size() < 2) {
    return DataLossError("event: " + std::to_string(bytes.size()) +
                         " bytes, must be at least 2 (version, kind)");
  }
  if (version != kEventVersion) {
    return DataLossError("event.version: " + std::to_string(version) + ", must be " +
                         std::to_string(kEventVersion));
  }
  Event event;
  if (!ReadFields(reader, index, event, std::make_index_sequence<std::variant_size_v<Event>>())) {
    return DataLossError("event.kind: " + std::to_string(index) + ", must be below " +
                         std::to_string(std::variant_size_v<Event>));
  }
  LOCI_RETURN_IF_ERROR(reader.Finish("event"));
  return event;
}

}  // namespace loci
