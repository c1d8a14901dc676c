// SPDX-License-Identifier: Apache-2.0
// Watches what connections send without its becoming messages (reliability: endless messages).
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>

#include "server/base/clock.h"

namespace loci {

struct ConnectionLimits {
  std::size_t connection_backlog_max_bytes = 0;
  std::size_t total_backlog_max_bytes = 0;
  std::size_t backlog_suspect_bytes = 0;
  std::size_t backlog_growth_max_bytes = 0;
};

// libzmq collects the frames of a message until the last one has come, without a bound and without
// a word to the application. What it holds is what the kernel has received on a connection less
// what came out of the socket as frames: both are known here, by file descriptor. One thread.
class ConnectionWatch {
 public:
  // `port` is where the connections come in; a descriptor that now belongs to something else is
  // told by it.
  ConnectionWatch(const ConnectionLimits& limits, std::uint16_t port);

  void OnOpened(int descriptor);
  void OnClosed(int descriptor);
  // False if the connection is not known.
  bool OnFrame(int descriptor, std::size_t size_bytes);

  // Shuts down the connections over the limits and returns how many these were. libzmq then drops
  // them as if their peers had left.
  std::size_t Check(TimePoint now);

  std::size_t connection_count() const { return connections_.size(); }

 private:
  struct Connection {
    std::uint64_t delivered_bytes = 0;
    std::uint64_t backlog_bytes = 0;
  };
  bool Measure(int descriptor, Connection& connection) const;
  std::size_t Cut(std::uint64_t backlog_min_bytes);
  void ReturnMemory(TimePoint now);

  const ConnectionLimits limits_;
  const std::uint16_t port_;
  std::unordered_map<int, Connection> connections_;
  // Resident memory when the backlog was last harmless.
  std::size_t resident_base_bytes_ = 0;
  bool trim_due_ = false;
  TimePoint trim_time_;
};

}  // namespace loci
