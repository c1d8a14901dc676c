// SPDX-License-Identifier: Apache-2.0
// The programs as a user runs them.
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include "clients/cli/evaluation.h"
#include "tests/support/matchers.h"
#include "tests/support/server_process.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

using google::protobuf::Struct;
using testing::HasSubstr;

struct Outcome {
  int code = -1;
  std::string out;
};

// Runs loci with the problems in the same text as the results, or without them.
enum class Problems { kShown, kDropped };
Outcome Loci(const std::string& words, Problems problems = Problems::kShown) {
  const std::string line = std::string(LOCI_LOCI) + " " + words +
                           (problems == Problems::kShown ? " 2>&1" : " 2>/dev/null");
  std::FILE* pipe = ::popen(line.c_str(), "r");
  Outcome outcome;
  std::array<char, 4096> buffer = {};
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe)) {
    outcome.out.append(buffer.data(), count);
  }
  const int status = ::pclose(pipe);
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

Struct Json(const std::string& text) {
  Struct object;
  EXPECT_TRUE(google::protobuf::util::JsonStringToMessage(text, &object).ok()) << text;
  return object;
}
double Number(const Struct& object, const std::string& key) {
  const auto field = object.fields().find(key);
  EXPECT_TRUE(field != object.fields().end() && field->second.has_number_value()) << key;
  return field == object.fields().end() ? 0.0 : field->second.number_value();
}

class ProgramTest : public testing::Test {
 protected:
  std::string Path(const std::string& name) const { return (folder_.path() / name).string(); }

  void Start(const std::string& listen = "tcp://127.0.0.1:0") {
    server_ = std::make_unique<ServerProcess>(LOCI_LOCID, folder_.path() / "data", listen);
    server_option_ = " --server " + server_->endpoint();
  }

  // A short piece of the simulated office, as a log.
  std::string ShortLog(std::size_t lines) {
    EXPECT_EQ(Loci("simulate office --out " + Path("sim")).code, 0);
    std::ifstream whole(Path("sim/r1-1.clf"));
    std::ofstream piece(Path("short.clf"));
    std::string line;
    for (std::size_t i = 0; i < lines && std::getline(whole, line); ++i) {
      piece << line << '\n';
    }
    return Path("short.clf");
  }

  TemporaryDirectory folder_;
  std::unique_ptr<ServerProcess> server_;
  std::string server_option_;
};

TEST_F(ProgramTest, EndsWithTwoForUsageErrors) {
  for (const char* words : {"",
                            "nothing",
                            "map",
                            "map info",
                            "stream x",
                            "status --nope",
                            "stream x --map a --speed fast",
                            "simulate castle --out x",
                            "tile --map a 1 2",
                            "render --map a --out x --zoom 25"}) {
    EXPECT_EQ(Loci(words).code, 2) << words;
  }
  EXPECT_EQ(Loci("--help").code, 0);
  EXPECT_EQ(Loci("stream --help").code, 0);
  EXPECT_EQ(Loci("--version").code, 0);
}

TEST_F(ProgramTest, EndsWithThreeWithinTwoSecondsWithoutAServer) {
  for (const char* server : {"tcp://127.0.0.1:1", "tcp://192.0.2.1:5600"}) {
    const auto begin = std::chrono::steady_clock::now();
    const Outcome outcome = Loci(std::string("status --server ") + server);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2)) << server;
    EXPECT_EQ(outcome.code, 3) << outcome.out;
    EXPECT_THAT(outcome.out, HasSubstr(server));
    EXPECT_THAT(outcome.out, HasSubstr("hint:"));
  }
}

TEST_F(ProgramTest, EndsWithOneWhenServerOrInputSayNo) {
  Start();
  EXPECT_EQ(Loci("map info nothing" + server_option_).code, 1);
  EXPECT_THAT(Loci("map info nothing" + server_option_).out, HasSubstr("NOT_FOUND"));
  EXPECT_EQ(Loci("map create Bad.Name" + server_option_).code, 1);
  EXPECT_EQ(Loci("map create m --cell-size 7" + server_option_).code, 1);
  EXPECT_EQ(Loci("stream " + Path("none.clf") + " --map m" + server_option_).code, 1);
  EXPECT_EQ(Loci("map create m" + server_option_).code, 0);
  EXPECT_THAT(Loci("map create m" + server_option_).out, HasSubstr("ALREADY_EXISTS"));
  EXPECT_EQ(Loci("tile --map m 25 0 0 --out " + Path("t.png") + server_option_).code, 1);
  EXPECT_EQ(Loci("map delete m" + server_option_).code, 0);
  EXPECT_EQ(Loci("eval trajectory " + Path("a") + " " + Path("b")).code, 1);
}

TEST_F(ProgramTest, TakesALogToAMapAndTheMapToFiles) {
  Start();
  const std::string log = ShortLog(400);
  const Struct streamed = Json(
      Loci("stream " + log + " --map office --robot r1 --start 6.6,6.4,0 --json" + server_option_,
           Problems::kDropped)
          .out);
  const double scans = Number(streamed, "scans_sent");
  EXPECT_GT(scans, 190.0);
  EXPECT_EQ(Number(streamed, "accepted"), scans);
  EXPECT_EQ(Number(streamed, "last_durable_number"), scans);
  EXPECT_EQ(Number(streamed, "refused"), 0.0);
  EXPECT_GT(Number(streamed, "real_time_factor"), 1.0);
  EXPECT_EQ(streamed.fields().at("session").string_value(), "r1-1");
  EXPECT_TRUE(streamed.fields().at("map_created").bool_value());

  const Struct info = Json(Loci("map info office --json" + server_option_).out);
  for (const char* key : {"revision",
                          "last_event",
                          "sessions",
                          "places",
                          "landmarks_ltm",
                          "landmarks_stm",
                          "ltrs",
                          "closures"}) {
    Number(info, key);
  }
  EXPECT_GT(Number(info.fields().at("file_bytes").struct_value(), "total"), 0.0);
  EXPECT_EQ(info.fields().at("state_digest").string_value().size(), 32U);
  // A map this young has all its bytes in the log, and says so where 0 bytes would startle.
  EXPECT_NE(Loci("map info office" + server_option_).out.find("map 0, history 0, log "),
            std::string::npos);
  EXPECT_NE(Loci("map info office" + server_option_).out.find("no checkpoint yet"),
            std::string::npos);
  const Struct status = Json(Loci("status --json" + server_option_).out);
  EXPECT_TRUE(status.fields().at("ready").bool_value());
  const Struct& map = status.fields().at("maps").list_value().values(0).struct_value();
  EXPECT_GT(Number(map.fields().at("cells_written").struct_value(), "integrate"), 0.0);
  const Struct sessions = Json(Loci("session list --map office --json" + server_option_).out);
  EXPECT_EQ(Number(sessions.fields().at("sessions").list_value().values(0).struct_value(),
                   "accepted_count"),
            scans);

  ASSERT_EQ(Loci("export trajectory --map office --out " + Path("t.tum") + server_option_).code, 0);
  const auto poses = ReadTumFile(Path("t.tum"));
  ASSERT_THAT(poses, IsOk());
  EXPECT_EQ(static_cast<double>(poses->size()), scans);
  const Struct errors = Json(
      Loci("eval trajectory " + Path("t.tum") + " " + Path("sim/r1-1.truth.tum") + " --json").out);
  EXPECT_LT(Number(errors.fields().at("translation_m").struct_value(), "rms"), 0.15);
  ASSERT_EQ(Loci("export grid --map office --out " + Path("g.yaml") + server_option_).code, 0);
  const Struct agreement =
      Json(Loci("eval grid " + Path("g.yaml") + " " + Path("sim/plan.yaml") + " --json").out);
  EXPECT_GT(Number(agreement, "iou"), 0.6);
  EXPECT_EQ(
      Loci("render --map office --trajectory --mesh --out " + Path("m.png") + server_option_).code,
      0);
  EXPECT_EQ(Loci("tile --map office 8 0 0 --out " + Path("t.png") + server_option_).code, 0);
  EXPECT_GT(std::filesystem::file_size(Path("m.png")), 1000U);
  const Struct change = Json(Loci("watch --map office --count 1 --json" + server_option_).out);
  EXPECT_EQ(Number(change, "revision"), Number(info, "revision"));
  EXPECT_EQ(Loci("map verify office --json" + server_option_).code, 0);
  // A second run of the same robot gets the next name.
  EXPECT_THAT(
      Loci("stream " + log + " --map office --robot r1 --start 6.6,6.4,0" + server_option_).out,
      HasSubstr("session r1-2"));
}

TEST_F(ProgramTest, StopsAtADamagedLineAndGoesOnWhenToldToSkip) {
  Start();
  const std::string log = ShortLog(100);
  std::ofstream(log, std::ios::app) << "FLASER 3 1 2\n"
                                    << std::ifstream(Path("sim/r2-1.clf")).rdbuf();
  const Outcome stopped =
      Loci("stream " + log + " --map office --session s --robot r1" + server_option_);
  EXPECT_EQ(stopped.code, 1);
  EXPECT_THAT(stopped.out, HasSubstr(log + ":101:"));
  EXPECT_THAT(stopped.out, HasSubstr("--session s"));
  const Outcome skipped = Loci(
      "stream " + log + " --map office --session s --robot r1 --on-error skip" + server_option_);
  EXPECT_EQ(skipped.code, 0) << skipped.out;
  EXPECT_THAT(skipped.out, HasSubstr("going on with session s"));
  EXPECT_THAT(skipped.out, HasSubstr("1 damaged lines skipped"));
}

TEST_F(ProgramTest, OutlivesAKilledServer) {
  Start();
  const std::string endpoint = server_->endpoint();
  const std::string log = ShortLog(1200);
  Outcome streamed;
  std::thread robot([&] {
    streamed = Loci("stream " + log + " --map office --speed 100 --json" + server_option_,
                    Problems::kDropped);
  });
  // Killed when something is durable.
  while (Loci("session list --map office --json" + server_option_)
             .out.find("\"last_durable_number\":") == std::string::npos) {
  }
  server_->End(SIGKILL);
  Start(endpoint);
  robot.join();
  EXPECT_EQ(streamed.code, 0) << streamed.out;
  const Struct summary = Json(streamed.out);
  EXPECT_EQ(Number(summary, "last_durable_number"), Number(summary, "scans_sent"));
  EXPECT_GE(Number(summary, "interruptions"), 1.0);
  EXPECT_EQ(Loci("map verify office" + server_option_).code, 0);
}

}  // namespace
}  // namespace loci
