// SPDX-License-Identifier: Apache-2.0
// Watches what connections send without its becoming messages.
#include "server/transport/connection_watch.h"

#include <algorithm>
#include <chrono>
#include <cstdio>

#include <linux/tcp.h>
#include <malloc.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace loci {
namespace {

std::size_t ResidentBytes() {
  std::FILE* file = std::fopen("/proc/self/statm", "re");
  if (file == nullptr) {
    return 0;
  }
  unsigned long pages = 0;
  unsigned long resident_pages = 0;
  const int found = std::fscanf(file, "%lu %lu", &pages, &resident_pages);
  std::fclose(file);
  return found == 2 ? resident_pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) : 0;
}

// 0 if the descriptor is no socket of the internet.
std::uint16_t LocalPort(int descriptor) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  if (getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    return 0;
  }
  if (address.ss_family == AF_INET) {
    return ntohs(reinterpret_cast<const sockaddr_in*>(&address)->sin_port);
  }
  if (address.ss_family == AF_INET6) {
    return ntohs(reinterpret_cast<const sockaddr_in6*>(&address)->sin6_port);
  }
  return 0;
}

}  // namespace

ConnectionWatch::ConnectionWatch(const ConnectionLimits& limits, std::uint16_t port)
    : limits_(limits), port_(port), resident_base_bytes_(ResidentBytes()) {}

void ConnectionWatch::OnOpened(int descriptor) {
  connections_[descriptor] = {};
}

void ConnectionWatch::OnClosed(int descriptor) {
  connections_.erase(descriptor);
}

bool ConnectionWatch::OnFrame(int descriptor, std::size_t size_bytes) {
  const auto found = connections_.find(descriptor);
  if (found == connections_.end()) {
    return false;
  }
  // ZMTP 3 puts 2 bytes before a frame, and 9 before one of more than 255 bytes.
  found->second.delivered_bytes += size_bytes + (size_bytes > 255 ? 9U : 2U);
  return true;
}

bool ConnectionWatch::Measure(int descriptor, Connection& connection) const {
  tcp_info info{};
  socklen_t size = sizeof info;
  if (LocalPort(descriptor) != port_ ||
      getsockopt(descriptor, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) {
    return false;
  }
  const std::uint64_t received = info.tcpi_bytes_received;
  connection.backlog_bytes =
      received > connection.delivered_bytes ? received - connection.delivered_bytes : 0;
  return true;
}

std::size_t ConnectionWatch::Check(TimePoint now) {
  std::uint64_t total = 0;
  std::uint64_t largest = 0;
  for (auto& [descriptor, connection] : connections_) {
    if (!Measure(descriptor, connection)) {
      connection.backlog_bytes = 0;  // closed already; its event is on the way
    }
    total += connection.backlog_bytes;
    largest = std::max(largest, connection.backlog_bytes);
  }
  ReturnMemory(now);
  std::size_t cut = 0;
  if (largest > limits_.connection_backlog_max_bytes) {
    cut = Cut(limits_.connection_backlog_max_bytes);
  } else if (total > limits_.total_backlog_max_bytes) {
    cut = Cut(largest / 2);
  } else if (total <= limits_.backlog_suspect_bytes) {
    resident_base_bytes_ = trim_due_ ? resident_base_bytes_ : ResidentBytes();
  } else if (ResidentBytes() > resident_base_bytes_ + limits_.backlog_growth_max_bytes) {
    cut = Cut(largest / 2);
  }
  if (cut > 0) {
    // libzmq's thread frees what it held a moment later; then it goes back to the system.
    trim_due_ = true;
    trim_time_ = now + std::chrono::milliseconds(200);
  }
  return cut;
}

// Those with more than this, which is never none: the largest is over half of itself.
std::size_t ConnectionWatch::Cut(std::uint64_t backlog_min_bytes) {
  std::size_t count = 0;
  for (auto& [descriptor, connection] : connections_) {
    if (connection.backlog_bytes > backlog_min_bytes) {
      shutdown(descriptor, SHUT_RDWR);
      ++count;
    }
  }
  return count;
}

void ConnectionWatch::ReturnMemory(TimePoint now) {
  if (trim_due_ && now >= trim_time_) {
    trim_due_ = false;
    malloc_trim(0);
    resident_base_bytes_ = ResidentBytes();
  }
}

}  // namespace loci
