// SPDX-License-Identifier: Apache-2.0
// `loci map ...`: administration of maps.
#pragma once

#include <vector>

#include "clients/cli/command.h"

namespace loci::cli {

// map create, list, info, delete and verify.
std::vector<Command> MakeMapCommands();

}  // namespace loci::cli
