// SPDX-License-Identifier: Apache-2.0
// The server as a whole: maps, calls over ZeroMQ, and HTTP.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "core/base/status.h"
#include "server/config.h"

namespace loci {

struct ServerOptions {
  std::filesystem::path data;                   // made if it is missing
  std::string listen = "tcp://127.0.0.1:5600";  // port 0 takes a free one
  std::string http = "127.0.0.1:5680";          // the same; empty: no HTTP
  bool insecure = false;                        // may listen where other machines reach it
  std::string version;                          // of the program
  ServerLimits limits;
};

// kInvalidArgument for an endpoint that is none, whatever the machine and `insecure` say.
Status CheckEndpoints(const ServerOptions& options);

// Serves from Start to Stop. Start and Stop are called by one thread.
class Server {
 public:
  // Returns as soon as calls are answered; maps are recovered meanwhile. Errors:
  // kInvalidArgument (an endpoint that is none, or one that needs `insecure`), kUnavailable (an
  // address is taken, the directory cannot be used), kFailedPrecondition (another server has the
  // directory).
  static StatusOr<std::unique_ptr<Server>> Start(const ServerOptions& options);
  ~Server();

  // With the real ports.
  const std::string& rpc_endpoint() const;
  // "127.0.0.1:5680"; empty without HTTP.
  const std::string& http_endpoint() const;

  // Ends all calls, then stops the maps with a last checkpoint each.
  void Stop();

 private:
  class Parts;
  explicit Server(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace loci
