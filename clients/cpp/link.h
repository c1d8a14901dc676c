// SPDX-License-Identifier: Apache-2.0
// One connection of a client to a server: what a channel needs of a wire.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

namespace loci::client {

// What a link has to say.
struct LinkEvent {
  enum class Kind {
    kNothing,    // the time is over, or Wake was called
    kConnected,  // messages can be sent
    kMessage,    // envelope and body came
    kLost,       // there was a connection and it is gone; `reason`
    kRefused,    // a connection could not be made; `reason`
  };
  Kind kind = Kind::kNothing;
  std::string envelope;
  std::string body;
  std::string reason;
};

// All functions but Wake are called by one thread. After kLost and kRefused the link is closed.
class Link {
 public:
  virtual ~Link() = default;
  // Begins a new connection; a link that is open is closed first.
  virtual void Open() = 0;
  virtual void Close() = 0;
  // False: not now; nothing was taken.
  virtual bool Send(const std::string& envelope, const std::string& body) = 0;
  // Waits for an event. With `read_messages` false, messages stay where they are, so that the
  // server's sending slows down.
  virtual LinkEvent Wait(std::chrono::milliseconds timeout, bool read_messages) = 0;
  // Any thread: ends the present or the next Wait.
  virtual void Wake() = 0;
};

using LinkFactory = std::function<std::unique_ptr<Link>(const std::string& endpoint)>;

// A link over ZeroMQ (DEALER), for endpoints tcp://HOST:PORT.
std::unique_ptr<Link> MakeZmqLink(const std::string& endpoint);

}  // namespace loci::client
