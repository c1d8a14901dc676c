// SPDX-License-Identifier: Apache-2.0
// What a stream's reader and its channel share.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <utility>

#include "core/base/status.h"

namespace loci::client {

// Any thread may call.
class StreamState {
 public:
  // `wake` tells the channel that there is room again, `cancel` ends the call.
  void Connect(std::function<void()> wake, std::function<void()> cancel) {
    wake_ = std::move(wake);
    cancel_ = std::move(cancel);
  }

  void Push(std::string body) {
    {
      const std::lock_guard lock(mutex_);
      if (ended_) {
        return;
      }
      unread_bytes_ += body.size();
      messages_.push_back(std::move(body));
    }
    changed_.notify_all();
  }

  // The messages that came before may still be read.
  void End(const Status& status) {
    {
      const std::lock_guard lock(mutex_);
      if (ended_) {
        return;
      }
      ended_ = true;
      status_ = status;
    }
    changed_.notify_all();
  }

  enum class Taken { kMessage, kEnd, kTimedOut };
  // Without a time, waits for ever.
  Taken Take(std::string& body, const std::chrono::milliseconds* timeout) {
    {
      std::unique_lock lock(mutex_);
      const auto ready = [this] { return ended_ || !messages_.empty(); };
      if (timeout == nullptr) {
        changed_.wait(lock, ready);
      } else if (!changed_.wait_for(lock, *timeout, ready)) {
        return Taken::kTimedOut;
      }
      if (messages_.empty()) {
        return Taken::kEnd;
      }
      body = std::move(messages_.front());
      messages_.pop_front();
      unread_bytes_ -= body.size();
    }
    wake_();
    return Taken::kMessage;
  }

  // Drops what was not read.
  void Abandon(const Status& status) {
    {
      const std::lock_guard lock(mutex_);
      messages_.clear();
      unread_bytes_ = 0;
    }
    End(status);
    cancel_();
  }

  Status status() const {
    const std::lock_guard lock(mutex_);
    return status_;
  }
  std::size_t unread_bytes() const {
    const std::lock_guard lock(mutex_);
    return unread_bytes_;
  }

 private:
  std::function<void()> wake_;
  std::function<void()> cancel_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::string> messages_;
  std::size_t unread_bytes_ = 0;
  bool ended_ = false;
  Status status_;
};

}  // namespace loci::client
