// SPDX-License-Identifier: Apache-2.0
// Envelopes: the first frame of every message.
#include "server/rpc/frame.h"

#include <algorithm>

#include <google/protobuf/stubs/logging.h>

namespace loci {
namespace {

// Length of the UTF-8 sequence at `text[at]`, 0 if it is none.
std::size_t Utf8Length(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t first = byte(at);
  if (first < 0x80U) {
    return 1;
  }
  const std::size_t length = first >= 0xF0U ? 4 : first >= 0xE0U ? 3 : 2;
  if (first < 0xC2U || first > 0xF4U || at + length > text.size()) {
    return 0;
  }
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0U) != 0x80U) {
      return 0;
    }
  }
  const std::uint8_t second = byte(at + 1);
  // Overlong forms, surrogates and what lies beyond the last code point.
  const bool forbidden = (first == 0xE0U && second < 0xA0U) || (first == 0xEDU && second > 0x9FU) ||
                         (first == 0xF0U && second < 0x90U) || (first == 0xF4U && second > 0x8FU);
  return forbidden ? 0 : length;
}

std::string ShortUtf8(std::string_view text) {
  std::string result;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t length = Utf8Length(text, at);
    if (result.size() + std::max<std::size_t>(length, 1) > kStatusMessageMaxBytes) {
      break;
    }
    if (length == 0) {
      result += '?';
      ++at;
    } else {
      result += text.substr(at, length);
      at += length;
    }
  }
  return result;
}

v1::Envelope Envelope(v1::FrameKind kind, std::uint64_t call_id) {
  v1::Envelope envelope;
  envelope.set_protocol_version(kProtocolVersion);
  envelope.set_kind(kind);
  envelope.set_call_id(call_id);
  return envelope;
}

}  // namespace

void SilenceParser() {
  google::protobuf::SetLogHandler(nullptr);
}

std::optional<v1::Envelope> ParseEnvelope(std::string_view bytes) {
  v1::Envelope envelope;
  if (bytes.size() > kEnvelopeMaxBytes ||
      !envelope.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return std::nullopt;
  }
  return envelope;
}

std::string ResponseEnvelope(std::uint64_t call_id) {
  return Envelope(v1::FRAME_KIND_RESPONSE, call_id).SerializeAsString();
}

std::string EndEnvelope(std::uint64_t call_id, const Status& status) {
  v1::Envelope envelope = Envelope(v1::FRAME_KIND_END, call_id);
  envelope.set_status_code(static_cast<std::uint32_t>(status.code()));
  envelope.set_status_message(ShortUtf8(status.message()));
  return envelope.SerializeAsString();
}

std::string PingEnvelope(std::uint64_t call_id) {
  return Envelope(v1::FRAME_KIND_PING, call_id).SerializeAsString();
}

std::string PongEnvelope(std::uint64_t call_id) {
  return Envelope(v1::FRAME_KIND_PONG, call_id).SerializeAsString();
}

}  // namespace loci
