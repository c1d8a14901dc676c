// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/context.h"

#include <thread>

#include "loci/v1/map_admin.pb.h"
#include "loci/v1/mapping.pb.h"

namespace loci::cli {

const std::shared_ptr<client::Channel>& Context::channel() {
  if (channel_ == nullptr) {
    client::ChannelOptions options;
    // A server that is not there is told within 2 s.
    options.connect_max = std::chrono::milliseconds(1500);
    channel_ = client::Channel::Create(server_, options);
  }
  return channel_;
}

Status Context::AwaitMap(const std::string& map) {
  constexpr std::chrono::milliseconds kPause{20};
  const auto end = std::chrono::steady_clock::now() + timeout_;
  // Asks what costs little and changes nothing.
  v1::ListSessionsRequest request;
  request.set_map(map);
  while (true) {
    const Status status =
        Call<v1::ListSessionsResponse>("loci.v1.Mapping/ListSessions", request).status();
    if (status.code() != StatusCode::kUnavailable ||
        std::chrono::steady_clock::now() + kPause > end) {
      return status;
    }
    // It is the map that is away if the server is there.
    if (!Call<v1::ServerStatus>("loci.v1.MapAdmin/GetServerStatus", v1::GetServerStatusRequest())
             .ok()) {
      return status;
    }
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace loci::cli
