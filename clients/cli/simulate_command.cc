// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/simulate_command.h"

#include <memory>
#include <ostream>
#include <string>

#include "clients/cli/json_output.h"
#include "clients/cli/simulation_files.h"
#include "clients/cli/text_output.h"
#include "clients/simulator/scenario.h"
#include "clients/simulator/simulation.h"

namespace loci::cli {
namespace {

struct SimulateOptions {
  std::string scenario;
  std::string out;
  std::uint64_t seed = 0;
};

Status Run(Context& context, const SimulateOptions& options) {
  LOCI_ASSIGN_OR_RETURN(const simulator::Scenario scenario,
                        simulator::MakeScenario(options.scenario));
  const std::vector<simulator::SimulatedSession> sessions =
      simulator::Simulate(scenario, options.seed);
  LOCI_RETURN_IF_ERROR(WriteSimulation(options.out, scenario, options.seed, sessions));
  if (context.json()) {
    JsonWriter json;
    json.BeginObject().Key("scenario").Value(options.scenario);
    json.Key("out").Value(options.out).Key("seed").Value(options.seed);
    json.Key("sessions").BeginArray();
    for (const simulator::SimulatedSession& session : sessions) {
      json.Value(session.session);
    }
    json.EndArray().EndObject();
    context.out() << json.text() << '\n';
    return {};
  }
  for (const simulator::SimulatedSession& session : sessions) {
    context.out() << session.session << ": " << session.scans.size() << " scans, "
                  << FixedText(session.distance_m, 1) << " m driven\n";
  }
  context.out() << "wrote logs, truth and scenario.json to " << options.out << '\n';
  return {};
}

}  // namespace

Command MakeSimulateCommand() {
  auto options = std::make_shared<SimulateOptions>();
  Command command;
  command.name = "simulate";
  command.needs_server = false;
  command.help =
      "Write logs of simulated robots, with the truth. Into the folder go, for every session, a "
      "log in CARMEN's format and the true trajectory (TUM); the true floor plan (PGM and YAML); "
      "and scenario.json, which names them and tells where each robot starts.\n\nScenarios:";
  std::vector<std::string> names;
  for (const simulator::ScenarioName& scenario : simulator::ScenarioNames()) {
    command.help += "\n  " + scenario.name + ": " + scenario.what;
    names.push_back(scenario.name);
  }
  command.examples = "simulate office --out out\nsimulate loop --out out --seed 7";
  command.arguments = {{.name = "SCENARIO",
                        .target = &options->scenario,
                        .help = "Which one",
                        .required = true,
                        .choices = names},
                       {.name = "--out",
                        .target = &options->out,
                        .help = "The folder to write; it is made if there is none",
                        .required = true,
                        .value_name = "DIR"},
                       {.name = "--seed",
                        .target = &options->seed,
                        .help = "Of noise, furniture and doors (default 0)"}};
  command.run = [options](Context& context) { return Run(context, *options); };
  return command;
}

}  // namespace loci::cli
