// SPDX-License-Identifier: Apache-2.0
// The built-in scenarios, and what they are built of.
#pragma once

#include <cstdint>
#include <vector>

#include "clients/simulator/scenario.h"

namespace loci::simulator {

Scenario MakeOffice();
Scenario MakeOfficeDays();
Scenario MakeLoop();
Scenario MakeSelfSimilar();
Scenario MakeLongCorridor();

// Puts desks, cabinets and chairs into a room between two corners, off the ways of the robots. The
// same `layout` gives the same room, relative to `low`.
void Furnish(FloorPlan& plan,
             const Eigen::Vector2d& low,
             const Eigen::Vector2d& high,
             std::uint64_t layout,
             const std::vector<std::vector<Eigen::Vector2d>>& ways);

}  // namespace loci::simulator
