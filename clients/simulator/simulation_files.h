// SPDX-License-Identifier: Apache-2.0
// A simulation on disk: logs as robots write them, and the truth to judge maps by.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/simulator/simulation.h"
#include "core/base/status.h"

namespace loci::simulator {

// Names of the files of one run, relative to the folder.
struct RunFiles {
  std::string log;    // CARMEN
  std::string truth;  // TUM, of the robot, in the frame of the building
};

// Writes into `directory`, which is made if it is missing:
//   <session>.clf, <session>.truth.tum   for each run
//   floor_plan.pgm, floor_plan.yaml      what stood on the last day and was met by a beam within
//                                        15 m, in cells of 0.05 m; the rest is unknown
//   scenario.json                        name, seed, floor plan, and for each run robot, session,
//                                        day, log, truth and start (x, y, theta)
// kUnavailable names the file that could not be written.
StatusOr<std::vector<RunFiles>> WriteSimulation(const Scenario& scenario,
                                                std::uint64_t seed,
                                                const std::vector<SimulatedRun>& runs,
                                                const std::string& directory);

}  // namespace loci::simulator
