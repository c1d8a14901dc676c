// SPDX-License-Identifier: Apache-2.0
// The only file that knows CLI11.
#include "clients/cli/command_line.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <memory>
#include <ostream>
#include <sstream>

#include <unistd.h>

#include <CLI/CLI.hpp>

namespace loci::cli {
namespace {

// What all commands share.
struct CommonOptions {
  std::string server = std::string(kDefaultServer);
  double timeout_s = 30.0;
  bool json = false;
};

template <typename T>
std::string DefaultValueName(const T*) {
  return "N";
}
std::string DefaultValueName(const std::string*) {
  return "TEXT";
}
std::string DefaultValueName(const double*) {
  return "NUMBER";
}

template <typename T>
CLI::Option* AddTarget(CLI::App& app, const Argument& argument, T* target) {
  CLI::Option* option = app.add_option(argument.name, *target, argument.help);
  option->type_name(argument.value_name.empty() ? DefaultValueName(target) : argument.value_name);
  return option;
}
template <typename T>
CLI::Option* AddTarget(CLI::App& app, const Argument& argument, std::optional<T>* target) {
  const auto assign = [target](const T& value) { *target = value; };
  CLI::Option* option = app.add_option_function<T>(argument.name, assign, argument.help);
  const T* type = nullptr;
  option->type_name(argument.value_name.empty() ? DefaultValueName(type) : argument.value_name);
  return option;
}
CLI::Option* AddTarget(CLI::App& app, const Argument& argument, std::vector<std::string>* target) {
  CLI::Option* option = app.add_option(argument.name, *target, argument.help);
  return option->type_name(argument.value_name.empty() ? "TEXT ..." : argument.value_name);
}
CLI::Option* AddTarget(CLI::App& app, const Argument& argument, bool* target) {
  return app.add_flag(argument.name, *target, argument.help);
}

void AddArgument(CLI::App& app, const Argument& argument) {
  CLI::Option* option =
      std::visit([&](auto* target) { return AddTarget(app, argument, target); }, argument.target);
  option->required(argument.required);
  if (!argument.choices.empty()) {
    option->check(CLI::IsMember(argument.choices));
  }
  if (argument.check) {
    option->check(CLI::Validator(
        [check = argument.check](const std::string& value) { return check(value); }, ""));
  }
}

std::string Examples(const std::string& lines) {
  std::istringstream stream(lines);
  std::string text = lines.empty() ? "" : "Examples:\n";
  for (std::string line; std::getline(stream, line);) {
    text += "  loci " + line + "\n";
  }
  return text;
}

// The node of a command's words, with its parents.
CLI::App* NodeOf(CLI::App& root, const std::string& name) {
  static const std::map<std::string, std::string> groups = {
      {"map", "Administration of maps"},
      {"session", "Sessions of a map"},
      {"export", "Take a map's content out, in formats that other programs read"},
      {"graph", "Pose graphs, offline"},
      {"eval", "Measure results against the truth"}};
  CLI::App* node = &root;
  std::istringstream words(name);
  for (std::string word; words >> word;) {
    const std::vector<CLI::App*> same =
        node->get_subcommands([&word](CLI::App* child) { return child->get_name() == word; });
    const auto group = groups.find(word);
    node = !same.empty() ? same.front()
                         : node->add_subcommand(word, group == groups.end() ? "" : group->second);
    if (!words.eof()) {
      node->require_subcommand(1);
    }
  }
  return node;
}

void AddCommand(CLI::App& root,
                const Command& command,
                CommonOptions& common,
                const Command** chosen) {
  CLI::App* app = NodeOf(root, command.name);
  // The first sentence stands in lists of commands, all of them in the command's own help.
  const std::size_t first_end = command.help.find(". ");
  const bool more = first_end != std::string::npos;
  app->description(command.help.substr(0, more ? first_end + 1 : std::string::npos));
  app->footer((more ? command.help.substr(first_end + 2) + "\n\n" : "") +
              Examples(command.examples));
  for (const Argument& argument : command.arguments) {
    AddArgument(*app, argument);
  }
  app->add_flag("--json", common.json, "Print the result as JSON");
  if (command.needs_server) {
    app->add_option("--server", common.server, "Endpoint of the server")
        ->type_name("tcp://HOST:PORT")
        ->envname("LOCI_SERVER")
        ->capture_default_str();
    app->add_option("--timeout", common.timeout_s, "Longest wait for an answer, in seconds")
        ->type_name("S")
        ->check(CLI::Range(0.001, 1e6))
        ->capture_default_str();
  }
  app->callback([chosen, &command] { *chosen = &command; });
}

// What may help, as far as code and message tell.
std::string Hint(const Status& status) {
  const auto says = [&status](std::string_view words) {
    return status.message().find(words) != std::string::npos;
  };
  switch (status.code()) {
    case StatusCode::kUnavailable:
      // Not for a map that recovers, or a call that was cut off.
      return says("is locid running there?") ? "start it with: locid --data DIR; or name another "
                                               "server with --server or LOCI_SERVER"
                                             : "";
    case StatusCode::kDeadlineExceeded:
      return "a longer --timeout may help";
    case StatusCode::kResourceExhausted:
      // Of other limits the message itself says what to do: wait, or ask for less.
      return says("the disk is full") ? "make room on the server's disk, then run the command again"
                                      : "";
    default:
      return {};
  }
}

void PrintError(const Status& status,
                const Command& command,
                const Context& context,
                std::ostream& error) {
  error << "loci " << command.name << ": " << status.ToString() << '\n';
  const bool network = ExitCodeOf(status) == ExitCode::kUnreachable;
  if (command.needs_server && network) {
    error << "  server: " << context.server() << '\n';
  }
  if (const std::string hint = Hint(status); command.needs_server && !hint.empty()) {
    error << "  hint: " << hint << '\n';
  }
}

}  // namespace

ExitCode ExitCodeOf(const Status& status) {
  switch (status.code()) {
    case StatusCode::kOk:
      return ExitCode::kDone;
    case StatusCode::kUnavailable:
    case StatusCode::kDeadlineExceeded:
      return ExitCode::kUnreachable;
    default:
      return ExitCode::kRefused;
  }
}

ExitCode RunCommandLine(const std::vector<Command>& commands,
                        const std::vector<std::string>& words,
                        std::ostream& out,
                        std::ostream& error) {
  CLI::App root(
      "Loci: a long-term map server for robot fleets. This program is its client: it\n"
      "streams logs, asks for maps and pictures, and administers maps.",
      "loci");
  root.require_subcommand(1);
  root.set_version_flag("--version", std::string("loci ") + LOCI_VERSION);
  root.footer(
      "Exit codes: 0 done; 1 the server or the input said no; 2 usage; 3 the server was\n"
      "not reachable or the deadline passed. `loci COMMAND --help` shows examples.");
  CommonOptions common;
  const Command* chosen = nullptr;
  for (const Command& command : commands) {
    AddCommand(root, command, common, &chosen);
  }
  try {
    std::vector<std::string> reversed(words.rbegin(), words.rend());  // as CLI11 wants them
    root.parse(reversed);
  } catch (const CLI::ParseError& problem) {
    return root.exit(problem, out, error) == 0 ? ExitCode::kDone : ExitCode::kUsage;
  }
  Context context(out, error);
  context.set_json(common.json);
  context.set_server(common.server);
  context.set_timeout_s(common.timeout_s);
  context.set_terminal(isatty(STDERR_FILENO) != 0);
  const Status status = chosen->run(context);
  out.flush();
  if (!status.ok()) {
    PrintError(status, *chosen, context, error);
  }
  return ExitCodeOf(status);
}

}  // namespace loci::cli
