// SPDX-License-Identifier: Apache-2.0
// What every command has at hand: the server, the output, and how the user wants it.
#pragma once

#include <chrono>
#include <functional>
#include <iosfwd>
#include <memory>
#include <string>
#include <string_view>

#include <google/protobuf/message.h>

#include "clients/cpp/channel.h"
#include "core/base/status.h"

namespace loci::cli {

inline constexpr std::string_view kDefaultServer = "tcp://127.0.0.1:5600";

class Context {
 public:
  Context(std::ostream& out, std::ostream& error) : out_(out), error_(error) {}

  std::ostream& out() { return out_; }      // results
  std::ostream& error() { return error_; }  // progress and problems
  bool json() const { return json_; }
  const std::string& server() const { return server_; }
  std::chrono::microseconds timeout() const { return timeout_; }

  void set_json(bool json) { json_ = json; }
  void set_server(std::string server) { server_ = std::move(server); }
  void set_timeout_s(double timeout_s) {
    timeout_ = std::chrono::microseconds(static_cast<std::int64_t>(timeout_s * 1e6));
  }
  void set_terminal(bool terminal) { terminal_ = terminal; }

  // Whether somebody watches: progress is shown then.
  bool terminal() const { return terminal_; }

  // The connection, made when first used.
  const std::shared_ptr<client::Channel>& channel();

  // Waits, within the user's timeout, while the server recovers the map after a start. A map that
  // is not there or is refused is an error at once, and so is a server that cannot be reached.
  Status AwaitMap(const std::string& map);

  // One call with the user's timeout; UNAVAILABLE at once if the server is not there.
  template <typename Response>
  StatusOr<Response> Call(std::string_view method, const google::protobuf::MessageLite& request) {
    client::CallOptions options;
    options.timeout = timeout_;
    return channel()->Call<Response>(method, request, options);
  }

  // A stream that must end within the user's timeout.
  template <typename Response>
  client::StreamReader<Response> Stream(std::string_view method,
                                        const google::protobuf::MessageLite& request) {
    client::CallOptions options;
    options.timeout = timeout_;
    return channel()->Stream<Response>(method, request, options);
  }

 private:
  std::ostream& out_;
  std::ostream& error_;
  bool json_ = false;
  bool terminal_ = false;
  std::string server_ = std::string(kDefaultServer);
  std::chrono::microseconds timeout_{30'000'000};
  std::shared_ptr<client::Channel> channel_;
};

}  // namespace loci::cli
