// SPDX-License-Identifier: Apache-2.0
// `loci stream` on a disk that is full: it waits, and goes on when there is room.
#include <chrono>
#include <csignal>
#include <cstdint>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/programs.h"
#include "tests/support/scarce_room.h"

namespace loci {
namespace {

using std::chrono::seconds;

constexpr std::uint64_t kScans = 600;

class FullDiskStreamTest : public ProgramsTest, public testing::WithParamInterface<Shortage> {};

TEST_P(FullDiskStreamTest, TheClientWaitsForRoomAndTheMapIsThatOfAnUndisturbedRun) {
  ScarceRoom room(GetParam());
  if (!room.possible()) {
    GTEST_SKIP() << "mounting a tmpfs is not allowed here";
  }
  const std::string log = WriteOfficeLog(Path("log"), kScans);
  StartServer();
  Stream(log, "hall");
  const Outcome expected = OutcomeOf("hall");
  EXPECT_EQ(server().End(SIGTERM), 0);

  StartServerOn(room.maps());
  ASSERT_EQ(Loci({"map", "create", "hall"}).exit_code, 0);
  room.RunOut(server(), 96U << 10U);
  Program stream(Command({"stream",
                          log,
                          "--map",
                          "hall",
                          "--session",
                          "run",
                          "--batch",
                          "8",
                          "--retry-for",
                          "60",
                          "--json"}));
  ASSERT_TRUE(Becomes([&] {
    return stream.error().find("RESOURCE_EXHAUSTED") != std::string::npos;
  })) << "the log fits, or the client was not told: "
      << stream.error();
  // It lives, answers, and refuses others too.
  const std::uint64_t durable = SessionOf("hall").last_durable_number();
  EXPECT_LT(durable, kScans);
  EXPECT_EQ(LociJson({"status"})["ready"], true);
  EXPECT_EQ(HttpGet(server().http_port(), "/healthz").status, 200);
  EXPECT_FALSE(stream.Ends(seconds(1))) << stream.error();
  room.ComeBack(server());
  ASSERT_EQ(stream.Wait(), 0) << stream.error();
  EXPECT_GT(nlohmann::json::parse(stream.out())["interruptions"], 0);
  const Outcome outcome = OutcomeOf("hall");
  EXPECT_EQ(outcome.digest, expected.digest);
  EXPECT_TRUE(outcome.trajectory == expected.trajectory) << "the trajectories differ";
  EXPECT_EQ(LociJson({"map", "verify", "hall"})["state_digest"], expected.digest);
  EXPECT_EQ(server().End(SIGTERM), 0);
}

INSTANTIATE_TEST_SUITE_P(Shortages,
                         FullDiskStreamTest,
                         testing::Values(Shortage::kFileSystem, Shortage::kFileSize),
                         ShortageName);

}  // namespace
}  // namespace loci
