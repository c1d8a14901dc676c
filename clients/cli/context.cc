// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/context.h"

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

}  // namespace loci::cli
