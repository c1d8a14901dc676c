// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/command_line.h"

#include <memory>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace loci::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

struct Outcome {
  ExitCode code;
  std::string out;
  std::string error;
};

Outcome RunWords(const Command& command, const std::vector<std::string>& words) {
  std::ostringstream out;
  std::ostringstream error;
  const ExitCode code = RunCommandLine({command}, words, out, error);
  return {code, out.str(), error.str()};
}

struct Values {
  std::string map;
  double size = 0.0;
  std::int64_t x = 0;
  std::optional<std::string> start;
  bool flag = false;
};

Command Sample(const std::shared_ptr<Values>& values, Status status = {}) {
  Command command;
  command.name = "thing make";
  command.help = "Make a thing. It stays.";
  command.examples = "thing make a";
  command.arguments = {
      {.name = "MAP", .target = &values->map, .help = "A map", .required = true},
      {.name = "X", .target = &values->x, .help = "A number"},
      {.name = "--size", .target = &values->size, .help = "A size"},
      {.name = "--start", .target = &values->start, .help = "A pose", .check = CheckPose},
      {.name = "--flag", .target = &values->flag, .help = "A flag"}};
  command.run = [values, status](Context& context) {
    context.out() << values->map << ' ' << values->x << ' ' << context.server()
                  << (context.json() ? " json" : "");
    return status;
  };
  return command;
}

TEST(CommandLineTest, FillsTheArgumentsOfACommand) {
  auto values = std::make_shared<Values>();
  const Outcome outcome = RunWords(Sample(values),
                                   {"thing",
                                    "make",
                                    "office",
                                    "-3",
                                    "--size",
                                    "0.5",
                                    "--flag",
                                    "--json",
                                    "--start",
                                    "-1,2.5,0",
                                    "--server",
                                    "tcp://x:1"});
  EXPECT_EQ(outcome.code, ExitCode::kDone) << outcome.error;
  EXPECT_EQ(outcome.out, "office -3 tcp://x:1 json");
  EXPECT_EQ(values->size, 0.5);
  EXPECT_TRUE(values->flag);
  EXPECT_EQ(values->start, "-1,2.5,0");
}

TEST(CommandLineTest, EndsWithUsageForEveryWrongWord) {
  auto values = std::make_shared<Values>();
  const std::vector<std::vector<std::string>> wrong = {{},
                                                       {"nothing"},
                                                       {"thing"},
                                                       {"thing", "break"},
                                                       {"thing", "make"},
                                                       {"thing", "make", "a", "b"},
                                                       {"thing", "make", "a", "1", "more"},
                                                       {"thing", "make", "a", "--size", "big"},
                                                       {"thing", "make", "a", "--start", "1,2"},
                                                       {"thing", "make", "a", "--nope"},
                                                       {"thing", "make", "a", "--timeout", "-1"}};
  for (const std::vector<std::string>& words : wrong) {
    const Outcome outcome = RunWords(Sample(values), words);
    EXPECT_EQ(outcome.code, ExitCode::kUsage) << testing::PrintToString(words);
    EXPECT_NE(outcome.error, "");
  }
}

TEST(CommandLineTest, ExplainsCommandsWithExamples) {
  auto values = std::make_shared<Values>();
  const Outcome root = RunWords(Sample(values), {"--help"});
  EXPECT_EQ(root.code, ExitCode::kDone);
  EXPECT_THAT(root.out, HasSubstr("Exit codes"));
  const Outcome command = RunWords(Sample(values), {"thing", "make", "--help"});
  EXPECT_EQ(command.code, ExitCode::kDone);
  EXPECT_THAT(command.out, HasSubstr("It stays."));
  EXPECT_THAT(command.out, HasSubstr("loci thing make a"));
  EXPECT_THAT(command.out, HasSubstr("LOCI_SERVER"));
}

TEST(CommandLineTest, TurnsAStatusIntoAnExitCodeAndItsMessage) {
  auto values = std::make_shared<Values>();
  const Outcome refused =
      RunWords(Sample(values, NotFoundError("map: there is no \"a\"")), {"thing", "make", "a"});
  EXPECT_EQ(refused.code, ExitCode::kRefused);
  EXPECT_THAT(refused.error, HasSubstr("loci thing make: NOT_FOUND: map: there is no"));
  const Outcome late =
      RunWords(Sample(values, DeadlineExceededError("late")), {"thing", "make", "a"});
  EXPECT_EQ(late.code, ExitCode::kUnreachable);
  const Outcome away =
      RunWords(Sample(values, UnavailableError("nothing answers; is locid running there?")),
               {"thing", "make", "a"});
  EXPECT_EQ(away.code, ExitCode::kUnreachable);
  EXPECT_THAT(away.error, HasSubstr(std::string(kDefaultServer)));
  EXPECT_THAT(away.error, HasSubstr("hint:"));
}

TEST(CommandLineTest, AHintFitsItsCauseAndIsLeftOutWhereTheMessageSaysAll) {
  const auto error_of = [](const Status& status) {
    return RunWords(Sample(std::make_shared<Values>(), status), {"thing", "make", "a"}).error;
  };
  EXPECT_THAT(error_of(ResourceExhaustedError("map \"a\": the disk is full: a.loci")),
              HasSubstr("hint: make room on the server's disk"));
  EXPECT_THAT(error_of(UnavailableError("nothing answers; is locid running there?")),
              HasSubstr("hint: start it with: locid --data DIR"));
  for (const Status& status :
       {ResourceExhaustedError("session \"s\": 9 bytes wait to become durable; send again later"),
        ResourceExhaustedError(
            "the answer has 9 bytes, more than a message may have; ask for less"),
        UnavailableError("map \"a\" is recovering; call again in a moment")}) {
    EXPECT_THAT(error_of(status), Not(HasSubstr("hint:"))) << status.ToString();
  }
}

TEST(ParsePoseTest, TakesThreeNumbersAndNothingElse) {
  EXPECT_EQ(ParsePose("1.5,-2,0.25").value(), (Pose2{1.5, -2.0, 0.25}));
  for (const char* text :
       {"", "1", "1,2", "1,2,3,4", "1,2,x", "1 2 3", "nan,0,0", "1,,2", "1,2,3 "}) {
    EXPECT_FALSE(ParsePose(text).ok()) << text;
  }
}

}  // namespace
}  // namespace loci::cli
