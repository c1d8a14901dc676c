// SPDX-License-Identifier: Apache-2.0
// A client's link over the transport in memory.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "clients/cpp/link.h"
#include "server/transport/memory_transport.h"

namespace loci {

class MemoryLink : public client::Link {
 public:
  // `connect` gives null while the server is away.
  using Connect = std::function<std::unique_ptr<MemoryPeer>()>;
  explicit MemoryLink(Connect connect) : connect_(std::move(connect)) {}

  void Open() override {
    Close();
    SetPeer(connect_());
    opening_ = true;
  }
  void Close() override {
    SetPeer(nullptr);
    opening_ = false;
  }
  bool Send(const std::string& envelope, const std::string& body) override {
    const std::shared_ptr<MemoryPeer> peer = Peer();
    return peer != nullptr && peer->Send(envelope, body);
  }
  client::LinkEvent Wait(std::chrono::milliseconds timeout, bool read_messages) override {
    client::LinkEvent event;
    const std::shared_ptr<MemoryPeer> peer = Peer();
    if (std::exchange(opening_, false)) {
      event.kind =
          peer != nullptr ? client::LinkEvent::Kind::kConnected : client::LinkEvent::Kind::kRefused;
      event.reason = "cannot connect: nothing answers there";
      return event;
    }
    const TimePoint until = std::chrono::steady_clock::now() + timeout;
    if (peer == nullptr || !read_messages) {
      std::unique_lock lock(mutex_);
      changed_.wait_until(lock, until, [this] { return woken_; });
      woken_ = false;
      return event;
    }
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(woken_, false)) {
        return event;
      }
    }
    switch (peer->Receive(event.envelope, event.body, until)) {
      case MemoryPeer::Received::kMessage:
        event.kind = client::LinkEvent::Kind::kMessage;
        break;
      case MemoryPeer::Received::kNothing:
        break;
      case MemoryPeer::Received::kClosed:
        Close();
        event.kind = client::LinkEvent::Kind::kLost;
        event.reason = "the connection was lost";
        break;
    }
    return event;
  }
  void Wake() override {
    std::shared_ptr<MemoryPeer> peer;
    {
      const std::lock_guard lock(mutex_);
      woken_ = true;
      peer = peer_;
    }
    changed_.notify_all();
    if (peer != nullptr) {
      peer->Wake();
    }
  }

 private:
  std::shared_ptr<MemoryPeer> Peer() {
    const std::lock_guard lock(mutex_);
    return peer_;
  }
  void SetPeer(std::unique_ptr<MemoryPeer> peer) {
    std::shared_ptr<MemoryPeer> old = std::move(peer);  // goes without the lock
    const std::lock_guard lock(mutex_);
    peer_.swap(old);
  }

  const Connect connect_;
  bool opening_ = false;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool woken_ = false;
  std::shared_ptr<MemoryPeer> peer_;
};

}  // namespace loci
