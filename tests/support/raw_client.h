// SPDX-License-Identifier: Apache-2.0
// A client that sends any bytes: for requests that no library would make.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "core/base/check.h"

namespace loci {

class RawClient {
 public:
  explicit RawClient(std::uint16_t port)
      : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    LOCI_CHECK(socket_ >= 0);
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    // A test that waits in vain fails, it does not hang.
    const timeval patience = {.tv_sec = 10, .tv_usec = 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    LOCI_CHECK(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) ==
               0);
  }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;
  ~RawClient() { ::close(socket_); }

  // False if the server has closed.
  bool Send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent <= 0) {
        return false;
      }
      bytes.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }

  // What comes until `end` has come, or the server closes.
  std::string ReadUntil(std::string_view end) {
    while (received_.find(end) == std::string::npos && ReadMore()) {
    }
    const std::size_t found = received_.find(end);
    const std::size_t count = found == std::string::npos ? received_.size() : found + end.size();
    const std::string text = received_.substr(0, count);
    received_.erase(0, count);
    return text;
  }

  // All that comes until the server closes.
  std::string ReadToEnd() {
    while (ReadMore()) {
    }
    return std::exchange(received_, "");
  }

  // Whether the server closes the connection within `limit`; what it says before is kept.
  bool IsClosedWithin(std::chrono::milliseconds limit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (true) {
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      pollfd waiting = {.fd = socket_, .events = POLLIN, .revents = 0};
      if (left.count() <= 0 || ::poll(&waiting, 1, static_cast<int>(left.count())) != 1) {
        return false;
      }
      if (!ReadMore()) {
        return true;
      }
    }
  }

  // One answer with Content-Length.
  std::string ReadAnswer() {
    std::string answer = ReadUntil("\r\n\r\n");
    const std::string name = "Content-Length: ";
    const std::size_t at = answer.find(name);
    if (at == std::string::npos) {
      return answer;
    }
    const std::size_t size = std::stoul(answer.substr(at + name.size()));
    while (received_.size() < size && ReadMore()) {
    }
    answer += received_.substr(0, size);
    received_.erase(0, size);
    return answer;
  }

 private:
  bool ReadMore() {
    char buffer[4096];
    const ssize_t count = ::recv(socket_, buffer, sizeof(buffer), 0);
    if (count <= 0) {
      return false;
    }
    received_.append(buffer, static_cast<std::size_t>(count));
    return true;
  }

  int socket_;
  std::string received_;
};

}  // namespace loci
