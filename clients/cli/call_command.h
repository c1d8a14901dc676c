// SPDX-License-Identifier: Apache-2.0
// `loci call`: any method of a server, by its reflection and JSON, without generated code.
#pragma once

#include <iosfwd>
#include <string>

#include "clients/cpp/channel.h"
#include "core/base/status.h"

namespace loci::cli {

struct CallArguments {
  // "loci.v1.MapAdmin/GetMapInfo". Without "/": a service, whose methods are listed. Empty: all.
  std::string method;
  // The request in Protocol Buffers' JSON.
  std::string json = "{}";
  // One line for an answer instead of an indented one.
  bool compact = false;
  client::CallOptions options;
};

// Writes each answer to `out` as JSON.
//
// Errors: kNotFound names the methods that there are; kInvalidArgument says what is wrong with the
// JSON; else the server's.
Status RunCall(client::Channel& channel, const CallArguments& arguments, std::ostream& out);

}  // namespace loci::cli
