// SPDX-License-Identifier: Apache-2.0
#include "server/http/http_server.h"

#include <charconv>
#include <thread>
#include <utility>

#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/socket_base.hpp>
#include <boost/asio/steady_timer.hpp>

#include "server/http/http_connection.h"

namespace loci {
namespace {

namespace asio = boost::asio;
using Tcp = asio::ip::tcp;
using ErrorCode = boost::system::error_code;

// When accepting fails (no more file descriptors, say), trying at once would only spin.
constexpr std::chrono::milliseconds kAcceptPause{100};

constexpr std::string_view kTooManyConnections =
    "HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain; charset=utf-8\r\n"
    "Retry-After: 5\r\nConnection: close\r\nContent-Length: 21\r\n\r\ntoo many connections\n";

}  // namespace

StatusOr<HttpEndpoint> ParseHttpEndpoint(std::string_view text) {
  const std::string shown = "\"" + std::string(text) + "\"";
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) {
    return InvalidArgumentError("http: " + shown + ", must be ADDRESS:PORT");
  }
  std::string_view address_text = text.substr(0, colon);
  const std::string_view port_text = text.substr(colon + 1);
  if (address_text.size() > 2 && address_text.front() == '[' && address_text.back() == ']') {
    address_text = address_text.substr(1, address_text.size() - 2);
  }
  HttpEndpoint endpoint;
  const char* const port_end = port_text.data() + port_text.size();
  const std::from_chars_result parsed = std::from_chars(port_text.data(), port_end, endpoint.port);
  if (parsed.ec != std::errc() || parsed.ptr != port_end) {
    return InvalidArgumentError("http: port of " + shown + ", must be 0 to 65535");
  }
  ErrorCode error;
  const asio::ip::address address = asio::ip::make_address(std::string(address_text), error);
  if (error) {
    return InvalidArgumentError("http: address of " + shown +
                                ", must be an IP address such as 127.0.0.1 or [::1]");
  }
  endpoint.address = address.to_string();
  endpoint.loopback = address.is_loopback();
  return endpoint;
}

class HttpServer::Implementation {
 public:
  Implementation(const HttpServerOptions& options, HttpHandler handler, MetricRegistry& metrics)
      : shared_(options, std::move(handler), metrics),
        acceptor_(shared_.io),
        accept_timer_(shared_.io) {}

  Status Listen() {
    const HttpEndpoint& endpoint = shared_.options.endpoint;
    ErrorCode error;
    const asio::ip::address address = asio::ip::make_address(endpoint.address, error);
    if (error) {
      return InvalidArgumentError("http: address \"" + endpoint.address + "\" is no IP address");
    }
    const Tcp::endpoint where(address, endpoint.port);
    acceptor_.open(where.protocol(), error);
    if (!error) {
      acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    }
    if (!error) {
      acceptor_.bind(where, error);
    }
    if (!error) {
      acceptor_.listen(asio::socket_base::max_listen_connections, error);
    }
    if (error) {
      return UnavailableError("http: cannot listen on " + endpoint.address + " port " +
                              std::to_string(endpoint.port) + ": " + error.message());
    }
    port_ = acceptor_.local_endpoint().port();
    return Status();
  }

  void Run() {
    Accept();
    thread_ = std::thread([this] { shared_.io.run(); });
  }

  void Stop() {
    if (!thread_.joinable()) {
      return;
    }
    asio::post(shared_.io, [this] { CloseAll(); });
    shared_.workers.stop();
    shared_.workers.join();
    asio::post(shared_.io, [this] {
      CloseAll();  // those that a render had in hand meanwhile
      shared_.io.stop();
    });
    thread_.join();
  }

  std::uint16_t port() const { return port_; }

 private:
  void CloseAll() {
    ErrorCode closed_already;
    acceptor_.close(closed_already);
    accept_timer_.cancel();
    for (const auto& [key, weak] : shared_.connections) {
      if (const std::shared_ptr<HttpConnection> connection = weak.lock()) {
        closing_.push_back(connection);
      }
    }
    for (const std::shared_ptr<HttpConnection>& connection : closing_) {
      connection->Close();
    }
    closing_.clear();
  }

  void Accept() {
    acceptor_.async_accept([this](const ErrorCode& error, Tcp::socket socket) {
      if (acceptor_.is_open()) {
        OnAccepted(error, std::move(socket));
      }
    });
  }

  void OnAccepted(const ErrorCode& error, Tcp::socket socket) {
    if (error) {
      AcceptAfterPause();
      return;
    }
    if (shared_.connections.size() < shared_.options.connection_count_max) {
      std::make_shared<HttpConnection>(std::move(socket), shared_)->Run();
    } else {
      Refuse(std::move(socket));
    }
    Accept();
  }

  void AcceptAfterPause() {
    accept_timer_.expires_after(kAcceptPause);
    accept_timer_.async_wait([this](const ErrorCode& cancelled) {
      if (!cancelled) {
        Accept();
      }
    });
  }

  // Never waits: the send buffer of a new socket has room for one line, and who is not read from
  // has to live with the reset.
  void Refuse(Tcp::socket socket) {
    shared_.refused_counter.Add();
    ErrorCode best_effort;
    socket.non_blocking(true, best_effort);
    socket.write_some(asio::buffer(kTooManyConnections), best_effort);
    socket.shutdown(Tcp::socket::shutdown_send, best_effort);
  }

  HttpShared shared_;
  std::vector<std::shared_ptr<HttpConnection>> closing_;
  Tcp::acceptor acceptor_;
  asio::steady_timer accept_timer_;
  std::uint16_t port_ = 0;
  std::thread thread_;
};

HttpServer::HttpServer(std::unique_ptr<Implementation> implementation)
    : implementation_(std::move(implementation)) {}

HttpServer::~HttpServer() {
  Stop();
}

StatusOr<std::unique_ptr<HttpServer>> HttpServer::Start(const HttpServerOptions& options,
                                                        HttpHandler handler,
                                                        MetricRegistry& metrics) {
  auto implementation = std::make_unique<Implementation>(options, std::move(handler), metrics);
  LOCI_RETURN_IF_ERROR(implementation->Listen());
  implementation->Run();
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(implementation)));
}

std::uint16_t HttpServer::port() const {
  return implementation_->port();
}

void HttpServer::Stop() {
  implementation_->Stop();
}

}  // namespace loci
