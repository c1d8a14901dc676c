// SPDX-License-Identifier: Apache-2.0
// Bringing two components of a pose graph into one frame.
#pragma once

#include <cstdint>

#include "core/geometry/se2.h"
#include "core/graph/pose_graph.h"

namespace loci {

// Moves the component of node `b` as a whole to where `a_from_b` says; or that of node `a`, if b's
// is tied to the map by something fixed or a prior. Moves nothing where both are tied, or are one
// component already.
void JoinComponents(std::uint32_t a, std::uint32_t b, const Pose2& a_from_b, PoseGraph& graph);

}  // namespace loci
