// SPDX-License-Identifier: Apache-2.0
// A piece of state as checkpoints store it.
#pragma once

#include <cstdint>
#include <string>

namespace loci {

// Kinds of records below this one follow the area of the map; from this one on they follow time:
// trajectories, sessions, closures. Storage counts their bytes apart.
inline constexpr std::uint32_t kFirstHistoryKind = 100;

// (kind, id) names it; the bytes say the rest.
struct StateRecord {
  std::uint32_t kind = 0;
  std::uint64_t id = 0;
  std::string bytes;
};

}  // namespace loci
