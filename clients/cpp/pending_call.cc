// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/pending_call.h"

#include <algorithm>
#include <utility>

#include "clients/cpp/stream_state.h"

namespace loci::client {
namespace {

constexpr std::uint32_t kProtocolVersion = 1;

}  // namespace

std::string Envelope(v1::FrameKind kind, std::uint64_t call_id) {
  v1::Envelope envelope;
  envelope.set_protocol_version(kProtocolVersion);
  envelope.set_kind(kind);
  envelope.set_call_id(call_id);
  return envelope.SerializeAsString();
}

std::string RequestEnvelope(std::uint64_t call_id,
                            const PendingCall& call,
                            std::chrono::steady_clock::time_point now) {
  v1::Envelope envelope;
  envelope.set_protocol_version(kProtocolVersion);
  envelope.set_kind(v1::FRAME_KIND_REQUEST);
  envelope.set_call_id(call_id);
  envelope.set_method(call.method);
  if (call.deadline.has_value()) {
    const auto left = std::chrono::duration_cast<std::chrono::microseconds>(*call.deadline - now);
    envelope.set_timeout_us(std::max<std::int64_t>(left.count(), 1));
  }
  envelope.mutable_metadata()->insert(call.options.metadata.begin(), call.options.metadata.end());
  return envelope.SerializeAsString();
}

void Complete(PendingCall call, const Status& status) {
  if (call.stream != nullptr) {
    call.stream->End(status);
  } else if (!status.ok()) {
    call.callback(status);
  } else if (call.response.has_value()) {
    call.callback(*std::move(call.response));
  } else {
    call.callback(InternalError(call.method + ": the server ended the call without an answer"));
  }
}

}  // namespace loci::client
