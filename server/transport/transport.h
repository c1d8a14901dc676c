// SPDX-License-Identifier: Apache-2.0
// The border between calls and wires: messages of exactly two frames, from and to peers.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "core/base/status.h"
#include "server/base/clock.h"

namespace loci {

// One connection of one client: opaque bytes, never used again for another connection while the
// server runs. A client that reconnects is a new peer.
using PeerId = std::string;

// One message to a peer.
struct OutgoingMessage {
  PeerId peer;
  std::string envelope;
  std::string body;
  // Called once, by any thread and with no lock of the transport held, when the operating system
  // has the bytes or when they were dropped: until then they cost memory. May be empty. It must be
  // short and must not throw.
  std::function<void()> on_released;
};

// What hears of messages. All functions are called by the transport's thread, one at a time.
class TransportSink {
 public:
  virtual ~TransportSink() = default;
  virtual void OnMessage(const PeerId& peer, std::string envelope, std::string body) = 0;
  // The peer cannot be reached any more. Not every loss is noticed: a peer that vanished shows when
  // something is sent to it.
  virtual void OnPeerGone(const PeerId& peer) = 0;
  // Called after every round of messages, and when the time that it returned last has come. Returns
  // when it wants to be called next.
  virtual TimePoint OnTick(TimePoint now) = 0;
};

// Counts since the start, for the metrics. Written by the transport, read by anyone.
struct TransportCounters {
  std::atomic<std::uint64_t> messages_in{0};
  std::atomic<std::uint64_t> messages_out{0};
  std::atomic<std::uint64_t> bytes_in{0};
  std::atomic<std::uint64_t> bytes_out{0};
  // Messages that had not exactly two frames.
  std::atomic<std::uint64_t> messages_ignored{0};
  // Messages dropped because their peer was gone.
  std::atomic<std::uint64_t> messages_undeliverable{0};
  // Connections open now, handshakes included.
  std::atomic<std::uint64_t> connections{0};
  // Connections closed because what they sent made no message and took too much memory.
  std::atomic<std::uint64_t> connections_cut{0};
  // Bytes handed to Send and not yet released.
  std::atomic<std::uint64_t> bytes_unsent{0};
};

// Carries messages between one server and many peers. Messages from and to one peer stay in order.
class Transport {
 public:
  virtual ~Transport() = default;

  // Begins to deliver to `sink`, which must live until Stop returns.
  virtual Status Start(TransportSink& sink) = 0;

  // Any thread. False after Stop: the message is not taken and its `on_released` is not called.
  // Never waits; who sends bounds what is unsent, with `on_released`.
  virtual bool Send(OutgoingMessage message) = 0;

  // Any thread: asks for OnTick soon.
  virtual void Wake() = 0;

  // Waits at most `drain` for what was sent to leave, then drops everything. No call to the sink is
  // made after it returns.
  virtual void Stop(Duration drain) = 0;

  // Where clients connect, with the real port.
  virtual std::string endpoint() const = 0;

  virtual const TransportCounters& counters() const = 0;
};

}  // namespace loci
