// SPDX-License-Identifier: Apache-2.0
// Messages inside one process, with the faults of a network: for tests and simulation.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include "core/base/status.h"
#include "server/base/clock.h"
#include "server/transport/transport.h"

namespace loci {

struct MemoryTransportOptions {
  std::uint64_t seed = 1;
  // Of each message, in both directions.
  double lose_probability = 0.0;
  double repeat_probability = 0.0;
  // Uniform from zero; messages of one direction of a connection stay in order.
  std::chrono::microseconds delay_max{0};
  // Messages that a peer may leave unread before what follows waits in the server.
  std::size_t inbox_max = 16;
  // True: nothing moves but in Step, and time is what the clock says. False: a thread of its own,
  // for the machine's clock.
  bool stepped = false;
};

class MemoryTransport;

// The client's end of a connection. Any thread may call.
class MemoryPeer {
 public:
  ~MemoryPeer();
  // False when the connection is closed.
  bool Send(std::string envelope, std::string body);
  enum class Received { kMessage, kNothing, kClosed };
  // Takes the next message, or waits for it until `until` (of the machine's clock). After Wake it
  // returns kNothing once.
  Received Receive(std::string& envelope, std::string& body, TimePoint until);
  void Wake();
  // What is on its way is lost in both directions.
  void Close();

 private:
  friend class MemoryTransport;
  struct State;
  MemoryPeer(std::shared_ptr<State> state, std::uint64_t number);
  const std::shared_ptr<State> state_;
  const std::uint64_t number_;
};

class MemoryTransport : public Transport {
 public:
  // `clock` must outlive it.
  MemoryTransport(const MemoryTransportOptions& options, const Clock& clock);
  MemoryTransport(const MemoryTransport&) = delete;
  MemoryTransport& operator=(const MemoryTransport&) = delete;
  ~MemoryTransport() override;

  // A new connection. Any thread; null after Stop.
  std::unique_ptr<MemoryPeer> Connect();

  // Delivers what is due. Returns when there may be more to do.
  TimePoint Step();

  Status Start(TransportSink& sink) override;
  bool Send(OutgoingMessage message) override;
  void Wake() override;
  void Stop(Duration drain) override;
  std::string endpoint() const override { return "memory"; }
  const TransportCounters& counters() const override;

 private:
  void Run();

  const std::shared_ptr<MemoryPeer::State> state_;
  TransportSink* sink_ = nullptr;
  std::thread thread_;
};

}  // namespace loci
