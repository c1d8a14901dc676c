// SPDX-License-Identifier: Apache-2.0
// Messages over one ZeroMQ ROUTER socket (docs/protocol.md, "Connections").
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "core/base/status.h"
#include "server/base/clock.h"
#include "server/transport/listen_endpoint.h"
#include "server/transport/transport.h"

namespace loci {

struct ZmqTransportOptions {
  // tcp://HOST:PORT; port 0 takes a free one.
  std::string endpoint = "tcp://127.0.0.1:5600";
  // A longer frame closes its connection: 4 MiB for the body and room for an envelope.
  std::size_t frame_max_bytes = (std::size_t{4} << 20U) + (std::size_t{64} << 10U);
  // Connections that have not finished ZeroMQ's handshake after this are closed.
  std::chrono::milliseconds handshake_max{3000};
  // Bytes that one connection, and all of them, may have sent without their having become messages.
  // An endless message of many frames never becomes one, and libzmq keeps all of it in memory: such
  // a connection is closed. The first must exceed what an honest peer can have on its way: a full
  // receive queue (16 messages of 4 MiB) and the system's socket buffer.
  std::size_t connection_backlog_max_bytes = std::size_t{96} << 20U;
  std::size_t total_backlog_max_bytes = std::size_t{256} << 20U;
  // While more than `backlog_suspect_bytes` are on their way, the process may grow by this much;
  // after that, the connections with the largest backlog are closed. Small frames cost up to 32
  // times their size, which the bounds above do not see.
  std::size_t backlog_suspect_bytes = std::size_t{4} << 20U;
  std::size_t backlog_growth_max_bytes = std::size_t{192} << 20U;
};

// Owns the socket and the thread that alone touches it. Start once, Stop once.
class ZmqTransport : public Transport {
 public:
  // Binds. kFailedPrecondition if libzmq is older than 4.3.3 (CVE-2020-15166), kUnavailable if the
  // address is taken, kInvalidArgument if it is none.
  static StatusOr<std::unique_ptr<ZmqTransport>> Listen(const ZmqTransportOptions& options);

  ZmqTransport(const ZmqTransport&) = delete;
  ZmqTransport& operator=(const ZmqTransport&) = delete;
  ~ZmqTransport() override;

  Status Start(TransportSink& sink) override;
  bool Send(OutgoingMessage message) override;
  void Wake() override;
  void Stop(Duration drain) override;
  std::string endpoint() const override;
  const TransportCounters& counters() const override;

 private:
  class Loop;
  explicit ZmqTransport(std::unique_ptr<Loop> loop);
  std::unique_ptr<Loop> loop_;
};

}  // namespace loci
