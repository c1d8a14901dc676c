// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_connection.h"

#include <array>
#include <utility>

#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/http/error.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/status.hpp>

#include "core/base/check.h"

namespace loci {
namespace {

namespace asio = boost::asio;
namespace http = boost::beast::http;

// What is read and dropped of a client that we are done with.
constexpr std::size_t kDrainBytesMax = 64 * 1024;

std::string StatusLine(unsigned status) {
  return "HTTP/1.1 " + std::to_string(status) + ' ' +
         std::string(http::obsolete_reason(http::int_to_status(status))) + "\r\n";
}

}  // namespace

HttpShared::HttpShared(const HttpServerOptions& server_options,
                       HttpHandler server_handler,
                       MetricRegistry& registry)
    : options(server_options),
      handler(std::move(server_handler)),
      metrics(registry),
      connections_gauge(registry.AddGauge("loci_http_connections", "Open HTTP connections.")),
      event_streams_gauge(registry.AddGauge("loci_http_event_streams", "Viewers listening.")),
      refused_counter(registry.AddCounter("loci_http_connections_refused_total",
                                          "Connections closed because there were too many.")),
      cut_counter(registry.AddCounter("loci_http_connections_cut_total",
                                      "Connections closed because the client was too slow.")),
      seconds_histogram(registry.AddHistogram("loci_http_answer_seconds",
                                              "From a whole request to its answer being sent.",
                                              LatencyBoundsS())),
      workers(server_options.worker_count) {}

void HttpShared::CountAnswer(unsigned status) {
  metrics
      .AddCounter("loci_http_answers_total",
                  "HTTP answers by status.",
                  {{"status", std::to_string(status)}})
      .Add();
}

HttpConnection::HttpConnection(asio::ip::tcp::socket socket, HttpShared& shared)
    : shared_(shared), stream_(std::move(socket)), event_timer_(shared.io) {
  shared_.connections_gauge.Add(1.0);
}

HttpConnection::~HttpConnection() {
  shared_.connections.erase(this);
  shared_.connections_gauge.Add(-1.0);
  if (event_stream_counted_) {
    --shared_.event_stream_count;
    shared_.event_streams_gauge.Add(-1.0);
  }
}

void HttpConnection::Run() {
  shared_.connections.emplace(this, weak_from_this());
  ErrorCode ignored;  // an answer in small pieces is slower without it, and that is all
  stream_.socket().set_option(asio::ip::tcp::no_delay(true), ignored);
  WaitForRequest(shared_.options.request_timeout);
}

void HttpConnection::Close() {
  events_.reset();
  event_timer_.cancel();
  stream_.close();
}

void HttpConnection::WaitForRequest(std::chrono::milliseconds timeout) {
  if (buffer_.size() > 0) {
    ReadRequest();
    return;
  }
  stream_.expires_after(timeout);
  stream_.async_read_some(buffer_.prepare(4096),
                          [self = shared_from_this()](const ErrorCode& error, std::size_t count) {
                            if (error) {
                              self->Close();
                              return;
                            }
                            self->buffer_.commit(count);
                            self->ReadRequest();
                          });
}

void HttpConnection::ReadRequest() {
  parser_.emplace();
  parser_->header_limit(shared_.options.header_bytes_max);
  stream_.expires_after(shared_.options.request_timeout);
  http::async_read_header(
      stream_, buffer_, *parser_, [self = shared_from_this()](const ErrorCode& error, std::size_t) {
        self->OnRequest(error);
      });
}

void HttpConnection::OnRequest(const ErrorCode& error) {
  request_begin_ = std::chrono::steady_clock::now();
  head_ = false;
  if (error == http::error::header_limit) {
    Reject(431,
           "request: line and headers must fit " +
               std::to_string(shared_.options.header_bytes_max) + " bytes");
    return;
  }
  if (error == http::error::end_of_stream || error == http::error::partial_message) {
    Close();
    return;
  }
  if (error.category() == http::make_error_code(http::error::bad_method).category() && error) {
    Reject(400, "request: no HTTP/1.1: " + error.message());
    return;
  }
  if (error) {
    if (error == boost::beast::error::timeout) {
      shared_.cut_counter.Add();
    }
    Close();
    return;
  }
  const auto& message = parser_->get();
  head_ = message.method() == http::verb::head;
  keep_alive_ = message.keep_alive();
  if (!head_ && message.method() != http::verb::get) {
    Reject(405, "method: must be GET or HEAD");
    return;
  }
  if (!parser_->is_done()) {
    Reject(413, "body: must be empty");
    return;
  }
  if_none_match_ = std::string(message[http::field::if_none_match]);
  const StatusOr<HttpRequest> request =
      ParseHttpTarget({message.target().data(), message.target().size()});
  Answer(request.ok() ? shared_.handler(*request) : ErrorResponse(request.status()));
}

void HttpConnection::Reject(unsigned status, std::string text) {
  keep_alive_ = false;
  HttpResponse response = TextResponse(status, std::move(text) + "\n");
  if (status == 405) {
    response.headers.emplace_back("Allow", "GET, HEAD");
  }
  Send(std::move(response));
}

void HttpConnection::Answer(HttpAnswer answer) {
  if (HttpResponse* const response = std::get_if<HttpResponse>(&answer)) {
    Send(std::move(*response));
  } else if (HttpWork* const work = std::get_if<HttpWork>(&answer)) {
    RunWork(std::move(*work));
  } else {
    StartEvents(std::get<HttpEventsStart>(answer));
  }
}

void HttpConnection::RunWork(HttpWork work) {
  if (shared_.work_count >= shared_.options.work_count_max) {
    Send(ErrorResponse(UnavailableError("renders under way: " + std::to_string(shared_.work_count) +
                                        ", the most; try again")));
    return;
  }
  ++shared_.work_count;
  // The connection moves to the worker and back: it must end on the socket thread.
  asio::post(shared_.workers, [self = shared_from_this(), work = std::move(work)]() mutable {
    asio::io_context& io = self->shared_.io;
    HttpResponse response = work();
    asio::post(io, [self = std::move(self), response = std::move(response)]() mutable {
      --self->shared_.work_count;
      self->Send(std::move(response));
    });
  });
}

void HttpConnection::Send(HttpResponse response) {
  const bool unchanged = response.status == 200 && !response.etag.empty() &&
                         EtagMatches(if_none_match_, response.etag);
  const unsigned status = unchanged ? 304 : response.status;
  header_out_ = StatusLine(status);
  if (!response.etag.empty()) {
    header_out_ += "ETag: " + response.etag + "\r\n";
  }
  if (!unchanged) {
    const std::size_t size_bytes = response.body ? response.body->size() : 0;
    header_out_ += "Content-Type: " + response.content_type + "\r\n";
    header_out_ += "Content-Length: " + std::to_string(size_bytes) + "\r\n";
  }
  for (const auto& [name, value] : response.headers) {
    header_out_ += name + ": " + value + "\r\n";
  }
  // A map changes at any time: a copy must be asked about before it is shown again.
  header_out_ += "Cache-Control: no-cache\r\nX-Content-Type-Options: nosniff\r\n";
  header_out_ += keep_alive_ ? "Connection: keep-alive\r\n\r\n" : "Connection: close\r\n\r\n";
  body_out_ = unchanged || head_ ? nullptr : std::move(response.body);
  if_none_match_.clear();
  shared_.CountAnswer(status);

  const asio::const_buffer body = body_out_ ? asio::buffer(*body_out_) : asio::const_buffer();
  stream_.expires_after(shared_.options.response_timeout);
  asio::async_write(
      stream_,
      std::array<asio::const_buffer, 2>{asio::buffer(header_out_), body},
      [self = shared_from_this()](const ErrorCode& error, std::size_t) { self->OnSent(error); });
}

void HttpConnection::OnSent(const ErrorCode& error) {
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - request_begin_;
  shared_.seconds_histogram.Observe(seconds.count());
  if (error) {
    if (error == boost::beast::error::timeout) {
      shared_.cut_counter.Add();
    }
    Close();
    return;
  }
  if (keep_alive_) {
    WaitForRequest(shared_.options.idle_timeout);
    return;
  }
  ErrorCode closed_already;
  stream_.socket().shutdown(asio::ip::tcp::socket::shutdown_send, closed_already);
  drain_bytes_left_ = kDrainBytesMax;
  stream_.expires_after(shared_.options.request_timeout);
  Drain();
}

void HttpConnection::Drain() {
  buffer_.clear();
  stream_.async_read_some(buffer_.prepare(4096),
                          [self = shared_from_this()](const ErrorCode& error, std::size_t count) {
                            if (error || count >= self->drain_bytes_left_) {
                              self->Close();
                              return;
                            }
                            self->drain_bytes_left_ -= count;
                            self->Drain();
                          });
}

void HttpConnection::StartEvents(const HttpEventsStart& start) {
  if (head_) {
    Reject(405, "method: a stream of events must be asked for by GET");
    return;
  }
  if (shared_.event_stream_count >= shared_.options.event_stream_count_max) {
    Send(ErrorResponse(
        UnavailableError("streams of events: " + std::to_string(shared_.event_stream_count) +
                         " are open, the most")));
    return;
  }
  StatusOr<std::unique_ptr<HttpEventSource>> source =
      start([weak = weak_from_this(), &io = shared_.io] {
        asio::post(io, [weak] {
          if (const std::shared_ptr<HttpConnection> self = weak.lock()) {
            self->OnWake();
          }
        });
      });
  if (!source.ok()) {
    Send(ErrorResponse(source.status()));
    return;
  }
  events_ = std::move(source).value();
  event_stream_counted_ = true;
  ++shared_.event_stream_count;
  shared_.event_streams_gauge.Add(1.0);
  shared_.CountAnswer(200);
  event_pending_ = true;
  WriteEvents(StatusLine(200) +
              "Content-Type: text/event-stream\r\nCache-Control: no-store\r\n"
              "X-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n");
  WatchForEnd();
}

// A viewer that listens says nothing more; its end shows as the end of what can be read.
void HttpConnection::WatchForEnd() {
  buffer_.clear();
  stream_.expires_never();
  stream_.async_read_some(buffer_.prepare(512),
                          [self = shared_from_this()](const ErrorCode& error, std::size_t) {
                            if (error) {
                              self->Close();
                            } else if (self->events_) {
                              self->WatchForEnd();
                            }
                          });
}

void HttpConnection::OnWake() {
  event_pending_ = true;
  if (events_ && !event_writing_ && !event_resting_) {
    SendEvents();
  }
}

void HttpConnection::SendEvents() {
  event_pending_ = false;
  std::string bytes = events_->Take();
  if (bytes.empty()) {
    WaitForKeepalive();
  } else {
    WriteEvents(std::move(bytes));
  }
}

void HttpConnection::WriteEvents(std::string bytes) {
  LOCI_CHECK(!event_writing_);
  event_writing_ = true;
  header_out_ = std::move(bytes);
  stream_.expires_after(shared_.options.response_timeout);
  asio::async_write(stream_,
                    asio::buffer(header_out_),
                    [self = shared_from_this()](const ErrorCode& error, std::size_t) {
                      self->event_writing_ = false;
                      if (error == boost::beast::error::timeout) {
                        self->shared_.cut_counter.Add();
                      }
                      if (error || !self->events_) {
                        self->Close();
                        return;
                      }
                      self->RestAfterEvents();
                    });
}

void HttpConnection::RestAfterEvents() {
  event_resting_ = true;
  event_timer_.expires_after(shared_.options.event_interval);
  event_timer_.async_wait([self = shared_from_this()](const ErrorCode& error) {
    if (error || !self->events_ || !self->event_resting_) {
      return;
    }
    self->event_resting_ = false;
    if (self->event_pending_) {
      self->SendEvents();
    } else {
      self->WaitForKeepalive();
    }
  });
}

void HttpConnection::WaitForKeepalive() {
  event_timer_.expires_after(shared_.options.event_keepalive);
  event_timer_.async_wait([self = shared_from_this()](const ErrorCode& error) {
    if (error || !self->events_ || self->event_writing_ || self->event_resting_) {
      return;
    }
    self->WriteEvents(": still here\n\n");
  });
}

}  // namespace loci
