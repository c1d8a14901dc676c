// SPDX-License-Identifier: Apache-2.0
// A piece of state as checkpoints store it.
#pragma once

#include <cstdint>
#include <string>

namespace loci {

// (kind, id) names it; the bytes say the rest.
struct StateRecord {
  std::uint32_t kind = 0;
  std::uint64_t id = 0;
  std::string bytes;
};

}  // namespace loci
