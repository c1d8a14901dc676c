// SPDX-License-Identifier: Apache-2.0
// `loci tile` and `loci call`: one question, one answer.
#pragma once

#include "clients/cli/command.h"

namespace loci::cli {

Command MakeTileCommand();
Command MakeCallCommand();

}  // namespace loci::cli
