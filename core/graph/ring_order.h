// SPDX-License-Identifier: Apache-2.0
// An order of elimination that leaves what is near some place for the end.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/graph/elimination_order.h"

namespace loci {

// All variables of a ring before those of any lower one, each ring in an order of little fill
// (EliminationOrder). `ring` has one number per variable.
std::vector<std::uint32_t> OrderByRings(const VariableGraph& graph,
                                        std::span<const std::uint32_t> ring);

}  // namespace loci
