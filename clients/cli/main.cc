// SPDX-License-Identifier: Apache-2.0
// The program `loci`: everything but the server.
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include "clients/cli/command_line.h"
#include "clients/cli/eval_command.h"
#include "clients/cli/export_command.h"
#include "clients/cli/map_command.h"
#include "clients/cli/offline/graph_command.h"
#include "clients/cli/query_command.h"
#include "clients/cli/render_command.h"
#include "clients/cli/session_command.h"
#include "clients/cli/simulate_command.h"
#include "clients/cli/status_command.h"
#include "clients/cli/stream_command.h"
#include "clients/cli/watch_command.h"

namespace {

std::vector<loci::cli::Command> AllCommands() {
  std::vector<loci::cli::Command> commands = {loci::cli::MakeStatusCommand(),
                                              loci::cli::MakeStreamCommand(),
                                              loci::cli::MakeSessionListCommand(),
                                              loci::cli::MakeRenderCommand(),
                                              loci::cli::MakeTileCommand(),
                                              loci::cli::MakeWatchCommand(),
                                              loci::cli::MakeCallCommand(),
                                              loci::cli::MakeSimulateCommand()};
  for (std::vector<loci::cli::Command> more : {loci::cli::MakeMapCommands(),
                                               loci::cli::MakeExportCommands(),
                                               loci::cli::MakeEvalCommands(),
                                               loci::cli::MakeGraphCommands()}) {
    std::move(more.begin(), more.end(), std::back_inserter(commands));
  }
  return commands;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<loci::cli::Command> commands = AllCommands();
  const std::vector<std::string> words(argv + (argc > 0 ? 1 : 0), argv + argc);
  return static_cast<int>(loci::cli::RunCommandLine(commands, words, std::cout, std::cerr));
}
