// SPDX-License-Identifier: Apache-2.0
// `loci stream` plays a log to locid, while one of them is killed again and again: the same log
// gives the same map, bit for bit.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/support/programs.h"

namespace loci {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::uint64_t kScans = 600;

class StreamTest : public ProgramsTest {
 protected:
  StreamTest() : log_(WriteOfficeLog(Path("log"), kScans)) { StartServer(); }

  const std::string& log() const { return log_; }

  Outcome Undisturbed() {
    const nlohmann::json summary = Stream(log_, "undisturbed");
    EXPECT_EQ(summary.value("interruptions", -1), 0);
    Outcome outcome = OutcomeOf("undisturbed");
    EXPECT_EQ(outcome.digest.size(), 32U);
    EXPECT_EQ(std::count(outcome.trajectory.begin(), outcome.trajectory.end(), '\n'),
              static_cast<std::ptrdiff_t>(kScans));
    return outcome;
  }

  // Every number that was acknowledged is there, and the map is `expected`.
  void ExpectWhole(const std::string& map, const Outcome& expected) {
    const nlohmann::json sessions = LociJson({"session", "list", "--map", map})["sessions"];
    ASSERT_EQ(sessions.size(), 1U);
    EXPECT_EQ(sessions[0]["state"], "closed");
    EXPECT_EQ(sessions[0]["last_durable_number"], kScans);
    EXPECT_EQ(sessions[0]["last_applied_number"], kScans);
    EXPECT_EQ(sessions[0]["accepted_count"], kScans);
    EXPECT_EQ(sessions[0]["refused_count"], 0);
    const Outcome outcome = OutcomeOf(map);
    EXPECT_EQ(outcome.digest, expected.digest);
    EXPECT_TRUE(outcome.trajectory == expected.trajectory) << "the trajectories differ";
    const nlohmann::json verified = LociJson({"map", "verify", map});
    EXPECT_EQ(verified["ok"], true);
    EXPECT_EQ(verified["state_digest"], expected.digest);
  }

 private:
  const std::string log_;
};

TEST_F(StreamTest, TheMapDependsOnTheLogAloneNotOnBatchesOrItsName) {
  const Outcome expected = Undisturbed();
  Stream(log(), "one", {"--batch", "1"});
  ExpectWhole("one", expected);
  Stream(log(), "a_thousand", {"--batch", "1000"});
  ExpectWhole("a_thousand", expected);
}

TEST_F(StreamTest, TwentyKillsOfTheServerLeaveTheMapOfAnUndisturbedRun) {
  constexpr std::uint64_t kKills = 20;
  const Outcome expected = Undisturbed();
  // Small batches, and a client that is held while the server recovers: or all of the log would be
  // durable after the first few kills.
  Program stream(Command({"stream",
                          log(),
                          "--map",
                          "killed",
                          "--session",
                          "run",
                          "--batch",
                          "4",
                          "--retry-for",
                          "60",
                          "--json"}));
  RandomSequence random(20260301);
  std::uint64_t durable = 0;
  std::uint64_t kills_in_the_middle = 0;  // of the log
  for (std::uint64_t kill = 0; kill < kKills; ++kill) {
    // Somewhere in each twentieth of the log, and at any moment of what the server does then. Every
    // fourth kill does not wait: the server still recovers from the one before.
    const std::uint64_t after = (kill * kScans + random.NextBits() % kScans) / kKills;
    const microseconds later(random.NextBits() % 20'000);
    if (kill % 4 != 3) {
      EXPECT_TRUE(Becomes([&] { return Loci({"status"}).exit_code == 0; }, seconds(5)));
      v1::SessionState session;
      const bool answers = Becomes([&] {
        session = SessionOf("killed");
        return !session.session().empty();
      });
      ASSERT_TRUE(answers) << stream.error();
      EXPECT_GE(session.last_durable_number(), durable) << "before kill " << kill;
      stream.GoOn();
      const bool moves = Becomes([&] {
        durable = std::max(durable, SessionOf("killed").last_durable_number());
        return durable > after;
      });
      ASSERT_TRUE(moves) << stream.error();
    }
    kills_in_the_middle += durable < kScans ? 1 : 0;
    if (kill % 2 == 1) {
      stream.Hold();  // its batches are on their way all the same
    }
    std::this_thread::sleep_for(later);
    EXPECT_EQ(server().End(SIGKILL), -SIGKILL);
    stream.Hold();
    StartServer();
  }
  stream.GoOn();
  ASSERT_EQ(stream.Wait(), 0) << stream.error();
  EXPECT_GT(kills_in_the_middle, kKills / 3);
  EXPECT_GT(nlohmann::json::parse(stream.out())["interruptions"], kKills / 4);
  ExpectWhole("killed", expected);
  EXPECT_EQ(server().End(SIGTERM), 0);
}

TEST_F(StreamTest, AKilledClientGoesOnWithItsSessionWhereTheServerHasIt) {
  constexpr std::uint64_t kKills = 5;
  const Outcome expected = Undisturbed();
  const Words words =
      Command({"stream", log(), "--map", "resumed", "--session", "run", "--batch", "4", "--json"});
  for (std::uint64_t kill = 1; kill <= kKills; ++kill) {
    Program stream(words);
    const std::uint64_t after = kill * kScans / (kKills + 1);
    ASSERT_TRUE(Becomes([&] { return SessionOf("resumed").last_durable_number() >= after; }))
        << stream.error();
    EXPECT_EQ(stream.End(SIGKILL), -SIGKILL);
  }
  const Ended last = RunProgram(words);
  ASSERT_EQ(last.exit_code, 0) << last.error;
  EXPECT_THAT(last.error, testing::HasSubstr("going on with session run"));
  EXPECT_GT(nlohmann::json::parse(last.out)["scans_passed_over"], 0);
  ExpectWhole("resumed", expected);
}

TEST_F(StreamTest, CommandsRightAfterARestartWaitForTheirMap) {
  const Outcome expected = Undisturbed();
  for (int kill = 0; kill < 2; ++kill) {
    EXPECT_EQ(server().End(SIGKILL), -SIGKILL);
    StartServer();
    const Outcome outcome = OutcomeOf("undisturbed");
    EXPECT_EQ(outcome.digest, expected.digest);
    EXPECT_TRUE(outcome.trajectory == expected.trajectory) << "the trajectories differ";
    EXPECT_EQ(server().End(SIGKILL), -SIGKILL);
    StartServer();
    EXPECT_EQ(LociJson({"map", "info", "undisturbed"})["state_digest"], expected.digest);
    EXPECT_EQ(Loci({"map", "info", "nowhere"}).exit_code, 1);
  }
}

TEST_F(StreamTest, AServerThatStaysAwayIsGivenUpAfterRetryForAlsoAtTheEnd) {
  Program stream(Command({"stream",
                          log(),
                          "--map",
                          "left",
                          "--session",
                          "run",
                          "--batch",
                          "1000",
                          "--retry-for",
                          "1"}));
  // All is durable and much of it not applied: the client waits for its session to be closed.
  ASSERT_TRUE(Becomes([&] { return SessionOf("left").last_durable_number() == kScans; }));
  server().End(SIGKILL);
  EXPECT_EQ(stream.Wait(seconds(15)), 3) << stream.error();
  EXPECT_THAT(stream.error(), testing::HasSubstr(endpoint()));
}

}  // namespace
}  // namespace loci
