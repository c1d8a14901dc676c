// SPDX-License-Identifier: Apache-2.0
// `loci stream`: plays a log to the server as a robot would.
#pragma once

#include "clients/cli/command.h"

namespace loci::cli {

Command MakeStreamCommand();

}  // namespace loci::cli
