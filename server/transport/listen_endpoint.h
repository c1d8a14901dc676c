// SPDX-License-Identifier: Apache-2.0
// Addresses that a server listens on.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/status.h"

namespace loci {

struct HostAndPort {
  std::string host;
  std::uint16_t port = 0;
};

// Nothing if `endpoint` is not tcp://HOST:PORT.
std::optional<HostAndPort> ParseEndpoint(std::string_view endpoint);

// Says whether a server may listen on `endpoint`: kInvalidArgument if it is not tcp://HOST:PORT, or
// if other machines can reach it and `insecure` is false, because nothing is encrypted or
// authenticated yet.
Status CheckListenEndpoint(std::string_view endpoint, bool insecure);

}  // namespace loci
