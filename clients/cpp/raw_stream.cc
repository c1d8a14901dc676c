// SPDX-License-Identifier: Apache-2.0
// Reads the messages of a server stream.
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "clients/cpp/channel.h"
#include "clients/cpp/stream_state.h"

namespace loci::client {

RawStream::RawStream(std::shared_ptr<StreamState> state) : state_(std::move(state)) {}
RawStream::RawStream(RawStream&&) noexcept = default;

RawStream& RawStream::operator=(RawStream&& other) noexcept {
  if (this != &other) {
    if (state_ != nullptr) {
      Cancel();
    }
    state_ = std::move(other.state_);
  }
  return *this;
}

RawStream::~RawStream() {
  if (state_ != nullptr) {
    Cancel();
  }
}

std::optional<std::string> RawStream::Next() {
  std::string body;
  if (state_->Take(body, nullptr) == StreamState::Taken::kMessage) {
    return body;
  }
  return std::nullopt;
}

RawStream::NextResult RawStream::Next(std::string& body, std::chrono::milliseconds timeout) {
  switch (state_->Take(body, &timeout)) {
    case StreamState::Taken::kMessage:
      return NextResult::kMessage;
    case StreamState::Taken::kEnd:
      return NextResult::kEnd;
    case StreamState::Taken::kTimedOut:
      break;
  }
  return NextResult::kTimedOut;
}

Status RawStream::status() const {
  return state_->status();
}

void RawStream::Cancel() {
  state_->Abandon(CancelledError("cancelled by its reader"));
}

void RawStream::Abandon(const Status& status) {
  state_->Abandon(status);
}

}  // namespace loci::client
