// SPDX-License-Identifier: Apache-2.0
// One client's connection to the HTTP server: read a request, answer, again; or stream events.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>

#include "server/http/http_message.h"
#include "server/http/http_server.h"
#include "server/metrics/metrics.h"

namespace loci {

class HttpConnection;

// What all connections of a server share. Used on the socket thread only.
struct HttpShared {
  HttpShared(const HttpServerOptions& options, HttpHandler handler, MetricRegistry& metrics);

  // Counts an answer; the status codes that we send are few.
  void CountAnswer(unsigned status);

  const HttpServerOptions options;
  const HttpHandler handler;
  MetricRegistry& metrics;
  Gauge& connections_gauge;
  Gauge& event_streams_gauge;
  Counter& refused_counter;
  Counter& cut_counter;
  Histogram& seconds_histogram;

  std::unordered_map<HttpConnection*, std::weak_ptr<HttpConnection>> connections;
  std::size_t event_stream_count = 0;
  std::size_t work_count = 0;

  // Last, in this order: what waits in them holds connections, which use all of the above.
  boost::asio::io_context io{1};
  boost::asio::thread_pool workers;
};

// Lives as long as an operation of it is under way. Used on the socket thread only.
class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  HttpConnection(boost::asio::ip::tcp::socket socket, HttpShared& shared);
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;
  ~HttpConnection();

  void Run();
  // Ends at once; what is under way comes to nothing.
  void Close();

 private:
  using Parser = boost::beast::http::request_parser<boost::beast::http::empty_body>;
  using ErrorCode = boost::beast::error_code;

  void WaitForRequest(std::chrono::milliseconds timeout);
  void ReadRequest();
  void OnRequest(const ErrorCode& error);
  // For a request after which the stream of bytes cannot be trusted: answers, then closes.
  void Reject(unsigned status, std::string text);
  void Answer(HttpAnswer answer);
  void RunWork(HttpWork work);
  void Send(HttpResponse response);
  void OnSent(const ErrorCode& error);
  // Reads and drops what still comes, so that the client can read the answer before the socket
  // closes: unread bytes would make the kernel reset the connection.
  void Drain();

  void StartEvents(const HttpEventsStart& start);
  void WatchForEnd();
  void OnWake();
  void SendEvents();
  void WriteEvents(std::string bytes);
  void RestAfterEvents();
  void WaitForKeepalive();

  HttpShared& shared_;
  boost::beast::tcp_stream stream_;
  boost::beast::flat_buffer buffer_;
  std::optional<Parser> parser_;  // one for each request
  std::string if_none_match_;
  bool head_ = false;
  bool keep_alive_ = false;
  std::size_t drain_bytes_left_ = 0;
  std::chrono::steady_clock::time_point request_begin_;

  // What is being written: it must stay until the write ends.
  std::string header_out_;
  std::shared_ptr<const std::string> body_out_;

  std::unique_ptr<HttpEventSource> events_;  // null: no stream of events
  bool event_stream_counted_ = false;
  bool event_writing_ = false;
  bool event_resting_ = false;  // within event_interval of the last event
  bool event_pending_ = false;  // woken meanwhile
  boost::asio::steady_timer event_timer_;
};

}  // namespace loci
