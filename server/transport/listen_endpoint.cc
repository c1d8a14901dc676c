// SPDX-License-Identifier: Apache-2.0
// Addresses that a server listens on.
#include "server/transport/listen_endpoint.h"

#include <charconv>
#include <system_error>

#include <arpa/inet.h>
#include <netinet/in.h>

namespace loci {
namespace {

bool IsLoopback(std::string_view host) {
  if (host == "localhost" || host == "[::1]") {
    return true;
  }
  in_addr address{};
  return inet_pton(AF_INET, std::string(host).c_str(), &address) == 1 &&
         (ntohl(address.s_addr) >> 24U) == 127U;
}

}  // namespace

std::optional<HostAndPort> ParseEndpoint(std::string_view endpoint) {
  constexpr std::string_view kScheme = "tcp://";
  const std::size_t colon = endpoint.rfind(':');
  if (!endpoint.starts_with(kScheme) || colon == std::string_view::npos ||
      colon <= kScheme.size()) {
    return std::nullopt;
  }
  HostAndPort result;
  result.host = endpoint.substr(kScheme.size(), colon - kScheme.size());
  const std::string_view digits = endpoint.substr(colon + 1);
  const auto [end, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), result.port);
  if (error != std::errc() || end != digits.data() + digits.size()) {
    return std::nullopt;
  }
  return result;
}

Status CheckListenEndpoint(std::string_view endpoint, bool insecure) {
  const std::optional<HostAndPort> parsed = ParseEndpoint(endpoint);
  if (!parsed.has_value()) {
    return InvalidArgumentError("listen address \"" + std::string(endpoint) +
                                "\": must be tcp://HOST:PORT with a port from 0 to 65535");
  }
  if (!insecure && !IsLoopback(parsed->host)) {
    return InvalidArgumentError(
        "listen address \"" + std::string(endpoint) +
        "\": other machines can reach it, and connections are neither encrypted nor authenticated; "
        "listen on 127.0.0.1, or say --insecure on a network that you trust");
  }
  return {};
}

}  // namespace loci
