// SPDX-License-Identifier: Apache-2.0
// `loci watch`: the change feed of a map.
#pragma once

#include "clients/cli/command.h"

namespace loci::cli {

Command MakeWatchCommand();

}  // namespace loci::cli
