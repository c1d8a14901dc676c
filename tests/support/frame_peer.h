// SPDX-License-Identifier: Apache-2.0
// A client that sends any frames over ZeroMQ: for messages that no library would make.
#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <zmq.hpp>

#include "loci/v1/envelope.pb.h"

namespace loci {

// A DEALER that sends whatever frames it is given.
class FramePeer {
 public:
  explicit FramePeer(const std::string& endpoint)
      : context_(1), socket_(context_, zmq::socket_type::dealer) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::rcvtimeo, 20'000);
    socket_.connect(endpoint);
  }
  void Send(const std::vector<std::string>& frames) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      socket_.send(zmq::buffer(frames[i]),
                   i + 1 < frames.size() ? zmq::send_flags::sndmore : zmq::send_flags::none);
    }
  }
  // The next envelope from the server; its body is dropped.
  v1::Envelope Receive() {
    v1::Envelope envelope;
    zmq::message_t frame;
    zmq::message_t body;
    if (socket_.recv(frame).has_value() && socket_.recv(body).has_value()) {
      EXPECT_TRUE(envelope.ParseFromArray(frame.data(), static_cast<int>(frame.size())));
    }
    return envelope;
  }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_;
};

}  // namespace loci
