// SPDX-License-Identifier: Apache-2.0
// `loci simulate`: logs with their truth.
#pragma once

#include "clients/cli/command.h"

namespace loci::cli {

Command MakeSimulateCommand();

}  // namespace loci::cli
