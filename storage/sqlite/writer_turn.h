// SPDX-License-Identifier: Apache-2.0
// A lock that is given in the order of asking.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace loci {

// Threads take turns at the one writing connection. std::mutex would let a checkpoint, which takes
// it again at once after each of its short transactions, starve the appender.
class WriterTurn {
 public:
  void lock() {
    std::unique_lock held(mutex_);
    const std::uint64_t ticket = next_ticket_++;
    changed_.wait(held, [&] { return ticket == serving_; });
  }
  void unlock() {
    const std::lock_guard held(mutex_);
    ++serving_;
    changed_.notify_all();  // at most three threads wait: appender, checkpoint, trim
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t next_ticket_ = 0;
  std::uint64_t serving_ = 0;
};

}  // namespace loci
