// SPDX-License-Identifier: Apache-2.0
// `loci status`: is the server ready, and how are its maps?
#pragma once

#include "clients/cli/command.h"

namespace loci::cli {

Command MakeStatusCommand();

}  // namespace loci::cli
