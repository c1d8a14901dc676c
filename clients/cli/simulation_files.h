// SPDX-License-Identifier: Apache-2.0
// A simulation as files: logs, true trajectories, true floor plan.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/cli/grid_file.h"
#include "clients/simulator/simulation.h"
#include "core/base/status.h"

namespace loci::cli {

// The log in CARMEN's format: FLASER with the laser's pose and the robot's, ODOM and PARAM lines.
// 81.91 is "nothing seen".
std::string CarmenLogOf(const simulator::SimulatedSession& session);

// The robot's true poses in the frame of the floor plan, in TUM format.
std::string TruthOf(const simulator::SimulatedSession& session);

// The floor plan on a day: occupied are the cells of surfaces that border on the room that can be
// reached from `start`, free is that room, all else is unknown (inside walls, behind closed doors).
OccupancyMap FloorPlanOf(const simulator::FloorPlan& plan,
                         std::uint64_t day,
                         std::uint64_t seed,
                         const Eigen::Vector2d& start,
                         double resolution_m);

// Writes all of it into a folder, which is made if it is missing: SESSION.clf and SESSION.truth.tum
// for each session, plan.pgm and plan.yaml (of the last day), and scenario.json that names them.
Status WriteSimulation(const std::string& folder,
                       const simulator::Scenario& scenario,
                       std::uint64_t seed,
                       const std::vector<simulator::SimulatedSession>& sessions);

}  // namespace loci::cli
