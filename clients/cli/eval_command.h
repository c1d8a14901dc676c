// SPDX-License-Identifier: Apache-2.0
// `loci eval ...`: results against the truth.
#pragma once

#include <vector>

#include "clients/cli/command.h"

namespace loci::cli {

// eval trajectory and eval grid.
std::vector<Command> MakeEvalCommands();

}  // namespace loci::cli
