// SPDX-License-Identifier: Apache-2.0
// What scripts rely on: exit codes, JSON fields, refusals.
#include <chrono>
#include <csignal>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/programs.h"

namespace loci {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

constexpr int kRefused = 1;
constexpr int kUsage = 2;
constexpr int kUnreachable = 3;

class CommandLineTest : public ProgramsTest {
 protected:
  Ended Locid(Words words) const {
    words.insert(words.begin(), LOCI_LOCID);
    return RunProgram(words);
  }
};

TEST_F(CommandLineTest, UsageErrorsEndWithTwoAndSayWhatIsWrong) {
  for (const Words& words : {Words{},
                             Words{"no-such-command"},
                             Words{"map"},
                             Words{"map", "create"},
                             Words{"status", "--no-such-option"},
                             Words{"stream", "--map", "hall"},
                             Words{"stream", "x.clf", "--map", "hall", "--batch", "0"},
                             Words{"stream", "x.clf", "--map", "hall", "--speed", "-1"},
                             Words{"tile", "--map", "hall", "8", "0", "--out", "t.png"},
                             Words{"tile", "--map", "hall", "8", "zero", "0", "--out", "t.png"}}) {
    Words command = words;
    command.insert(command.begin(), LOCI_CLI);
    const Ended ended = RunProgram(command);
    EXPECT_EQ(ended.exit_code, kUsage) << testing::PrintToString(words);
    EXPECT_FALSE(ended.error.empty()) << testing::PrintToString(words);
  }
  EXPECT_EQ(Locid({}).exit_code, kUsage);
  EXPECT_EQ(Locid({"--data", Path("d"), "--listen", "carrier-pigeon"}).exit_code, kUsage);
  EXPECT_EQ(Locid({"--data", Path("d"), "--http", "127.0.0.1:99999"}).exit_code, kUsage);
}

TEST_F(CommandLineTest, HelpAndVersionAreNoErrors) {
  for (const Words& words : {Words{LOCI_CLI, "--help"},
                             Words{LOCI_CLI, "stream", "--help"},
                             Words{LOCI_CLI, "--version"},
                             Words{LOCI_LOCID, "--help"},
                             Words{LOCI_LOCID, "--version"}}) {
    const Ended ended = RunProgram(words);
    EXPECT_EQ(ended.exit_code, 0) << testing::PrintToString(words);
    EXPECT_FALSE(ended.out.empty()) << testing::PrintToString(words);
  }
}

TEST_F(CommandLineTest, AServerThatIsAwayOrSilentEndsStatusWithThreeWithinTwoSeconds) {
  StartServer();
  EXPECT_EQ(Loci({"status"}).exit_code, 0);
  ::kill(server().pid(), SIGSTOP);  // it takes connections, and says nothing
  const Ended silent = Loci({"status"});
  EXPECT_EQ(silent.exit_code, kUnreachable);
  EXPECT_LT(silent.duration, milliseconds(2000));
  server().End(SIGKILL);
  const Ended away = Loci({"status"});
  EXPECT_EQ(away.exit_code, kUnreachable);
  EXPECT_LT(away.duration, milliseconds(2000));
  EXPECT_THAT(away.error, HasSubstr(endpoint()));
  EXPECT_EQ(Loci({"map", "list"}).exit_code, kUnreachable);
}

TEST_F(CommandLineTest, WhatIsNotThereEndsWithOneAndIsNamed) {
  StartServer();
  const std::string file = Path("out").string();
  for (const Words& words : {Words{"status", "--map", "nowhere"},
                             Words{"map", "info", "nowhere"},
                             Words{"map", "verify", "nowhere"},
                             Words{"map", "delete", "nowhere"},
                             Words{"session", "list", "--map", "nowhere"},
                             Words{"tile", "--map", "nowhere", "8", "0", "0", "--out", file},
                             Words{"export", "trajectory", "--map", "nowhere", "--out", file},
                             Words{"export", "grid", "--map", "nowhere", "--out", file},
                             Words{"watch", "--map", "nowhere"}}) {
    const Ended ended = Loci(words);
    EXPECT_EQ(ended.exit_code, kRefused) << testing::PrintToString(words) << ended.error;
    EXPECT_THAT(ended.error, HasSubstr("nowhere")) << testing::PrintToString(words);
  }
  EXPECT_EQ(Loci({"map", "create", "Not A Name"}).exit_code, kRefused);
  EXPECT_EQ(Loci({"stream", Path("no.clf").string(), "--map", "hall"}).exit_code, kRefused);
  ASSERT_EQ(Loci({"map", "create", "hall"}).exit_code, 0);
  EXPECT_EQ(Loci({"map", "create", "hall"}).exit_code, kRefused);
  EXPECT_EQ(Loci({"tile", "--map", "hall", "25", "0", "0", "--out", file}).exit_code, kRefused);
}

TEST_F(CommandLineTest, JsonHasTheFieldsThatScriptsReadAlsoOfAnEmptyMap) {
  StartServer();
  ASSERT_EQ(Loci({"map", "create", "empty"}).exit_code, 0);
  Stream(WriteOfficeLog(Path("log"), 60), "hall");
  for (const std::string map : {"empty", "hall"}) {
    SCOPED_TRACE(map);
    const nlohmann::json info = LociJson({"map", "info", map});
    for (const char* field : {"revision",
                              "last_event",
                              "sessions",
                              "places",
                              "landmarks_ltm",
                              "landmarks_stm",
                              "ltrs",
                              "closures"}) {
      EXPECT_TRUE(info[field].is_number_unsigned()) << field;
    }
    EXPECT_EQ(info["state_digest"].get<std::string>().size(), 32U);
    for (const char* field : {"map", "history", "log", "total"}) {
      EXPECT_TRUE(info["file_bytes"][field].is_number_unsigned()) << field;
    }
    const nlohmann::json status = LociJson({"status", "--map", map});
    EXPECT_EQ(status["ready"], true);
    ASSERT_EQ(status["maps"].size(), 1U);
    const nlohmann::json& entry = status["maps"][0];
    EXPECT_EQ(entry["map"], map);
    for (const char* field : {"revision",
                              "closures",
                              "last_closure_ms",
                              "max_closure_ms",
                              "last_closure_places_moved",
                              "chi2"}) {
      EXPECT_TRUE(entry[field].is_number()) << field;
    }
    for (const char* field : {"integrate", "consolidate", "remesh", "closure"}) {
      EXPECT_TRUE(entry["cells_written"][field].is_number_unsigned()) << field;
    }
  }
  EXPECT_NE(LociJson({"map", "info", "hall"})["state_digest"],
            LociJson({"map", "info", "empty"})["state_digest"]);
  const nlohmann::json session = LociJson({"session", "list", "--map", "hall"})["sessions"][0];
  for (const char* field : {"session",
                            "robot",
                            "state",
                            "first_stamp_ns",
                            "last_stamp_ns",
                            "accepted_count",
                            "refused_count"}) {
    EXPECT_TRUE(session.contains(field)) << field;
  }
  EXPECT_EQ(LociJson({"map", "list"})["maps"].size(), 2U);
}

TEST_F(CommandLineTest, AnAddressThatOthersCanReachNeedsInsecure) {
  const std::string data = Path("maps").string();
  const Ended rpc = Locid({"--data", data, "--listen", "tcp://0.0.0.0:0", "--http", "off"});
  EXPECT_EQ(rpc.exit_code, kRefused);
  EXPECT_THAT(rpc.error, HasSubstr("--insecure"));
  const Ended http =
      Locid({"--data", data, "--listen", "tcp://127.0.0.1:0", "--http", "0.0.0.0:0"});
  EXPECT_EQ(http.exit_code, kRefused);
  EXPECT_THAT(http.error, HasSubstr("--insecure"));
  Program allowed({LOCI_LOCID,
                   "--data",
                   data,
                   "--listen",
                   "tcp://0.0.0.0:0",
                   "--http",
                   "0.0.0.0:0",
                   "--insecure"});
  EXPECT_TRUE(Becomes([&] { return allowed.out().find('\n') != std::string::npos; }))
      << allowed.error();
  EXPECT_EQ(allowed.End(SIGINT), 0);
}

TEST_F(CommandLineTest, ASecondServerOnTheSameMapsIsRefusedAndTheFirstGoesOn) {
  StartServer();
  ASSERT_EQ(Loci({"map", "create", "hall"}).exit_code, 0);
  const Ended second =
      Locid({"--data", Path("maps"), "--listen", "tcp://127.0.0.1:0", "--http", "127.0.0.1:0"});
  EXPECT_EQ(second.exit_code, kRefused);
  EXPECT_THAT(second.error, HasSubstr(Path("maps").string()));
  const Ended same_port =
      Locid({"--data", Path("others"), "--listen", endpoint(), "--http", "off"});
  EXPECT_EQ(same_port.exit_code, kRefused);
  EXPECT_THAT(same_port.error, HasSubstr(endpoint()));
  EXPECT_EQ(Loci({"map", "info", "hall"}).exit_code, 0);
}

}  // namespace
}  // namespace loci
