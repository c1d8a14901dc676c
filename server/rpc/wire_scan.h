// SPDX-License-Identifier: Apache-2.0
// A look at Protocol Buffers' bytes before they are parsed: 4 MiB of empty messages become 272 MB.
#pragma once

#include <cstddef>
#include <string_view>

#include <google/protobuf/descriptor.h>

#include "core/base/status.h"

namespace loci {

// What a message may hold. The defaults are far over what any request of ours needs.
struct WireLimits {
  // Fields that cost memory of their own: messages, strings, bytes and unknown fields.
  std::size_t allocations_max = 65'536;
  std::size_t depth_max = 16;
};

// kInvalidArgument if `bytes` cannot be a message of `type` within `limits`; the message says
// where. Cost: one pass over the tags, without an allocation.
Status CheckWire(std::string_view bytes,
                 const google::protobuf::Descriptor& type,
                 const WireLimits& limits);

}  // namespace loci
