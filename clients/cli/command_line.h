// SPDX-License-Identifier: Apache-2.0
// Words of a command line become a command that runs; its status becomes an exit code.
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "clients/cli/command.h"
#include "core/base/status.h"

namespace loci::cli {

// design.md, section 8.
enum class ExitCode : int {
  kDone = 0,
  kRefused = 1,  // the server or the input said no
  kUsage = 2,
  kUnreachable = 3,  // or the deadline passed
};

ExitCode ExitCodeOf(const Status& status);

// Runs the command that the words after "loci" name. Results go to `out`; help too, if asked for;
// problems to `error`.
ExitCode RunCommandLine(const std::vector<Command>& commands,
                        const std::vector<std::string>& words,
                        std::ostream& out,
                        std::ostream& error);

}  // namespace loci::cli
