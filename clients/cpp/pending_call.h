// SPDX-License-Identifier: Apache-2.0
// A call of a channel that is not over, and the envelopes that a client sends.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "clients/cpp/channel.h"
#include "core/base/status.h"
#include "loci/v1/envelope.pb.h"

namespace loci::client {

// A call that is not over.
struct PendingCall {
  std::string method;
  std::string body;
  CallOptions options;
  std::optional<std::chrono::steady_clock::time_point> deadline;
  bool sent = false;
  Channel::RawCallback callback;        // of a unary call
  std::shared_ptr<StreamState> stream;  // of a stream
  std::optional<std::string> response;  // of a unary call that has not ended
};

// Gives the call's answer, or its end, to whoever waits for it.
void Complete(PendingCall call, const Status& status);

// What begins the call; its time counts from `now`.
std::string RequestEnvelope(std::uint64_t call_id,
                            const PendingCall& call,
                            std::chrono::steady_clock::time_point now);
// Any other: of a cancellation, a ping, a pong.
std::string Envelope(v1::FrameKind kind, std::uint64_t call_id);

}  // namespace loci::client
