// SPDX-License-Identifier: Apache-2.0
// An HTTP server for browsers and operators: GET and HEAD, bounded in every direction.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/status.h"
#include "server/http/http_message.h"
#include "server/metrics/metrics.h"

namespace loci {

struct HttpEndpoint {
  std::string address = "127.0.0.1";  // an IP address, no name
  std::uint16_t port = 0;             // 0: any free one
  bool loopback = true;               // derived from `address`
};

// Reads "127.0.0.1:5680" or "[::1]:5680".
// Errors: kInvalidArgument with what is wrong.
StatusOr<HttpEndpoint> ParseHttpEndpoint(std::string_view text);

// The limits. Defaults suit one machine with some hundred viewers; raise connection_count_max and
// event_stream_count_max together for more.
struct HttpServerOptions {
  HttpEndpoint endpoint;
  // A further client is told 503 and closed.
  std::size_t connection_count_max = 1024;
  // Viewers that listen to events; each holds a connection. More are told 503.
  std::size_t event_stream_count_max = 512;
  // Renders that wait or run. More are told 503 and to try again (reliability: 64 bounds both the
  // wait of the last one and the memory).
  std::size_t work_count_max = 64;
  std::size_t worker_count = 2;
  // Request line and headers. Browsers send below 1 KiB, with cookies of others perhaps 4 KiB.
  std::uint32_t header_bytes_max = 8 * 1024;
  // From the first byte of a request to its last: a client that drips bytes is cut.
  std::chrono::milliseconds request_timeout{5'000};
  // From the first byte of an answer to its last: a client that does not read is cut.
  std::chrono::milliseconds response_timeout{10'000};
  // Between two requests on one connection.
  std::chrono::milliseconds idle_timeout{30'000};
  // A stream of events tells at most so often; what happens meanwhile is merged.
  std::chrono::milliseconds event_interval{200};
  // A comment is sent to a quiet viewer so often: it finds the dead ones.
  std::chrono::milliseconds event_keepalive{15'000};
};

// Serves from Start() to the end of its life, on one thread for sockets and some for renders.
// Any thread may call Stop().
class HttpServer {
 public:
  // `handler` and `metrics` must outlive the server.
  // Errors: kUnavailable if the address cannot be listened on.
  static StatusOr<std::unique_ptr<HttpServer>> Start(const HttpServerOptions& options,
                                                     HttpHandler handler,
                                                     MetricRegistry& metrics);
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;
  ~HttpServer();

  // The port that it listens on; the one asked for, or the one found if that was 0.
  std::uint16_t port() const;

  // Closes all connections, whatever they do, and ends the threads. Waits for renders that run, not
  // for those that wait. May be called twice.
  void Stop();

 private:
  class Implementation;
  explicit HttpServer(std::unique_ptr<Implementation> implementation);

  std::unique_ptr<Implementation> implementation_;
};

}  // namespace loci
