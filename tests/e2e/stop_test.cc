// SPDX-License-Identifier: Apache-2.0
// locid ends within 5 s when told to, whoever hangs on.
#include <chrono>
#include <csignal>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/programs.h"

namespace loci {
namespace {

using std::chrono::seconds;

class StopTest : public ProgramsTest, public testing::WithParamInterface<int> {};

TEST_P(StopTest, TheServerEndsWithinFiveSecondsWhileClientsHangOn) {
  const std::string log = WriteOfficeLog(Path("log"), 600);
  StartServer();
  ASSERT_EQ(Loci({"map", "create", "hall"}).exit_code, 0);
  RawClient viewer(server().http_port());
  viewer.Send("GET /maps/hall/events HTTP/1.1\r\nHost: loci\r\n\r\n");
  EXPECT_THAT(viewer.ReadUntil("event: revision"), testing::HasSubstr("text/event-stream"));
  RawClient silent_viewer(server().http_port());
  RawClient slow_viewer(server().http_port());
  slow_viewer.Send("GET /maps HTT");
  RawClient silent_robot(server().rpc_port());
  RawClient slow_robot(server().rpc_port());
  slow_robot.Send(std::string("\xff\0\0\0\0\0\0\0\1\x7f\3", 11));  // the first of a greeting
  Program watcher(Command({"watch", "--map", "hall", "--timeout", "60"}));
  Program stream(Command(
      {"stream", log, "--map", "hall", "--session", "run", "--batch", "4", "--retry-for", "0"}));
  ASSERT_TRUE(Becomes([&] { return SessionOf("hall").last_durable_number() > 50; }))
      << stream.error();
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(server().End(GetParam()), 0);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, seconds(5));
  EXPECT_TRUE(viewer.IsClosedWithin(seconds(1)));
  EXPECT_TRUE(silent_robot.IsClosedWithin(seconds(1)));
  EXPECT_EQ(stream.Wait(seconds(10)), 3) << stream.error();
  EXPECT_THAT(stream.error(), testing::HasSubstr("--session run"));
  EXPECT_EQ(watcher.Wait(seconds(10)), 3) << watcher.error();
}

INSTANTIATE_TEST_SUITE_P(Signals,
                         StopTest,
                         testing::Values(SIGTERM, SIGINT),
                         [](const auto& signal) {
                           return std::string(signal.param == SIGTERM ? "Term" : "Interrupt");
                         });

}  // namespace
}  // namespace loci
