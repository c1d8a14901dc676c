// SPDX-License-Identifier: Apache-2.0
// Envelopes: the first frame of every message (docs/protocol.md, "Messages").
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/status.h"
#include "loci/v1/envelope.pb.h"

namespace loci {

inline constexpr std::uint32_t kProtocolVersion = 1;
// Envelopes are small: a method's name and some metadata.
inline constexpr std::size_t kEnvelopeMaxBytes = std::size_t{16} << 10U;
inline constexpr std::size_t kStatusMessageMaxBytes = std::size_t{4} << 10U;

// Ends what Protocol Buffers prints of its own accord, for the whole process: a line for every
// string that is no UTF-8, with which any peer could fill a disk. What does not parse is counted.
void SilenceParser();

// Nothing if the bytes are no envelope.
std::optional<v1::Envelope> ParseEnvelope(std::string_view bytes);

std::string ResponseEnvelope(std::uint64_t call_id);
// The end of a call. What is no UTF-8 in the message becomes '?', and a long one is cut, because a
// client could not parse it otherwise.
std::string EndEnvelope(std::uint64_t call_id, const Status& status);
std::string PingEnvelope(std::uint64_t call_id);
std::string PongEnvelope(std::uint64_t call_id);

}  // namespace loci
