// SPDX-License-Identifier: Apache-2.0
// `loci session list`: the runs of the robots in a map.
#pragma once

#include "clients/cli/command.h"

namespace loci::cli {

Command MakeSessionListCommand();

}  // namespace loci::cli
