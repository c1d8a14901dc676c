// SPDX-License-Identifier: Apache-2.0
// Names of things: small integers that cannot be mixed up.
#pragma once

#include <compare>
#include <cstdint>

namespace loci {

// An integer with a meaning. `Tag` only tells the types apart.
template <typename Tag, typename Integer>
struct Id {
  using ValueType = Integer;
  Integer value = 0;

  // clang-tidy 14 takes what the compiler makes of <=> for a null pointer.
  friend constexpr auto operator<=>(const Id&,
                                    const Id&) = default;  // NOLINT(modernize-use-nullptr)
};

// A node of the pose graph and the local map around it. Numbers start at 0 and are never used
// again.
using PlaceId = Id<struct PlaceTag, std::uint32_t>;
// One run of one robot. Numbers start at 0 in the order of opening.
using SessionId = Id<struct SessionTag, std::uint32_t>;
// A corner of the mesh.
using VertexId = Id<struct VertexTag, std::uint32_t>;
// A closure that was tried and listed, accepted or not.
using ClosureId = Id<struct ClosureTag, std::uint32_t>;
// Position of an event in a map's log; the first event (creation of the map) has 1.
using EventNumber = Id<struct EventTag, std::uint64_t>;
// Number of the last event that a published state contains. The revision of a map without
// observations is 1.
using Revision = EventNumber;

}  // namespace loci
