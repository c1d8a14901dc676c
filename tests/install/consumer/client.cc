// SPDX-License-Identifier: Apache-2.0
// Uses the C++ client: links to all that it needs, asks nobody.
#include "clients/cpp/channel.h"
#include "loci/v1/map_admin.pb.h"

bool CanName(const char* endpoint) {
  const auto channel = loci::client::Channel::Create(endpoint);
  loci::v1::GetMapInfoRequest request;
  request.set_map("hall");
  return request.IsInitialized();
}
