// SPDX-License-Identifier: Apache-2.0
// `loci export ...`: a map's content in formats that other programs read.
#pragma once

#include <vector>

#include "clients/cli/command.h"

namespace loci::cli {

// export trajectory and export grid.
std::vector<Command> MakeExportCommands();

}  // namespace loci::cli
