// SPDX-License-Identifier: Apache-2.0
// What a command of the command line is: its words, its arguments, and what it does.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "clients/cli/context.h"
#include "core/base/status.h"
#include "core/geometry/se2.h"

namespace loci::cli {

// Where the value of an argument goes. The targets live as long as the command.
using ArgumentTarget = std::variant<std::string*,
                                    std::optional<std::string>*,
                                    std::int64_t*,
                                    std::optional<std::int64_t>*,
                                    std::uint64_t*,
                                    std::optional<std::uint64_t>*,
                                    double*,
                                    std::optional<double>*,
                                    std::vector<std::string>*,
                                    bool*>;

struct Argument {
  // "--map", "-d,--data" for options, "LOG" for an argument that is known by its position.
  std::string name;
  ArgumentTarget target;
  std::string help;
  bool required = false;
  // How the help names the value; by default by its type.
  std::string value_name = {};
  // If not empty, the only values allowed.
  std::vector<std::string> choices = {};
  // If there is one: what is wrong with a value, or nothing. A wrong value is a usage error.
  std::function<std::string(const std::string& value)> check = {};
};

struct Command {
  std::string name;      // words, "map create"
  std::string help;      // one line, then as many as it takes
  std::string examples;  // one a line, without "loci"
  std::vector<Argument> arguments;
  // False: an offline tool, which has no --server and no --timeout.
  bool needs_server = true;
  std::function<Status(Context& context)> run;
};

// "1.5,-2,0.1" as a pose: metres, metres, radians. The message of the error begins with the text.
StatusOr<Pose2> ParsePose(const std::string& text);
// The same for Argument::check.
std::string CheckPose(const std::string& text);

}  // namespace loci::cli
