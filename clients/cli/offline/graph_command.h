// SPDX-License-Identifier: Apache-2.0
// `loci graph optimize`: optimisation of a pose graph in a file.
#pragma once

#include <vector>

#include "clients/cli/command.h"

namespace loci::cli {

std::vector<Command> MakeGraphCommands();

}  // namespace loci::cli
