// SPDX-License-Identifier: Apache-2.0
// A real server process, killed and stopped while robots stream.
#include <chrono>
#include <csignal>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cpp/channel.h"
#include "clients/cpp/mapping_session.h"
#include "core/base/random.h"
#include "loci/v1/map_admin.pb.h"
#include "loci/v1/map_query.pb.h"
#include "tests/support/matchers.h"
#include "tests/support/observation_messages.h"
#include "tests/support/room_drive.h"
#include "tests/support/server_process.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

constexpr std::uint64_t kDriveLength = 600;
constexpr std::uint64_t kKills = 20;
// Several between two kills, so that a kill also meets one that is being written.
constexpr std::uint64_t kCheckpointEvents = 11;

const std::vector<std::string> kOptions = {"--checkpoint-events",
                                           std::to_string(kCheckpointEvents)};

struct Outcome {
  std::string digest;
  std::vector<std::string> trajectory;  // one message each
};

client::MappingSessionOptions SessionOptions() {
  client::MappingSessionOptions options;
  options.map = "hall";
  options.session = "run";
  options.robot = "robot";
  options.batch_observations_max = 7;
  return options;
}

void CreateMap(client::Channel& channel) {
  v1::CreateMapRequest request;
  request.set_map("hall");
  ASSERT_THAT(channel.Call<v1::CreateMapResponse>("loci.v1.MapAdmin/CreateMap", request), IsOk());
}

std::unique_ptr<client::MappingSession> OpenSession(std::shared_ptr<client::Channel> channel) {
  auto session = client::MappingSession::Open(std::move(channel), SessionOptions());
  EXPECT_THAT(session, IsOk());
  return std::move(session).value();
}

// Appends the whole drive and closes.
void StreamAll(client::MappingSession& session) {
  for (const ObservationEvent& observation : RoomDrive(kDriveLength)) {
    ASSERT_THAT(session.Append(MessageOf(observation)), IsOk());
  }
  const auto closed = session.Close();
  ASSERT_THAT(closed, IsOk());
  EXPECT_EQ(closed->last_durable_number(), kDriveLength);
  EXPECT_EQ(closed->accepted_count(), kDriveLength);
}

// How the map came back at the server's start.
v1::ServerStatus::Map StatusOf(client::Channel& channel) {
  v1::GetServerStatusRequest request;
  request.set_map("hall");
  client::CallOptions options;
  options.wait_for_ready = true;
  for (;;) {
    const auto status =
        channel.Call<v1::ServerStatus>("loci.v1.MapAdmin/GetServerStatus", request, options);
    if (status.ok() && status->ready()) {
      return status->maps(0);
    }
    // The connection that the kill broke, or a map that recovers.
    if (!status.ok() && status.status().code() != StatusCode::kUnavailable) {
      ADD_FAILURE() << status.status().ToString();
      return {};
    }
  }
}

Outcome OutcomeOf(client::Channel& channel) {
  Outcome outcome;
  v1::GetMapInfoRequest request;
  request.set_map("hall");
  const auto info = channel.Call<v1::MapInfo>("loci.v1.MapAdmin/GetMapInfo", request);
  EXPECT_THAT(info, IsOk());
  outcome.digest = info->state_digest();
  v1::StreamTrajectoryRequest trajectory;
  trajectory.set_map("hall");
  auto stream =
      channel.Stream<v1::TrajectoryPoses>("loci.v1.MapQuery/StreamTrajectory", trajectory);
  v1::TrajectoryPoses poses;
  while (stream.Next(poses)) {
    for (const v1::StampedPose& pose : poses.poses()) {
      outcome.trajectory.push_back(pose.SerializeAsString());
    }
  }
  EXPECT_THAT(stream.status(), IsOk());
  return outcome;
}

TEST(KillTest, TwentyKillsLeaveTheSameDigestAndTrajectoryBitForBit) {
  Outcome expected;
  {
    const TemporaryDirectory disk;
    ServerProcess server(LOCI_LOCID, disk.path());
    const auto channel = client::Channel::Create(server.endpoint());
    CreateMap(*channel);
    StreamAll(*OpenSession(channel));
    expected = OutcomeOf(*channel);
    EXPECT_EQ(server.End(SIGTERM), 0);
  }
  ASSERT_EQ(expected.trajectory.size(), kDriveLength);

  const TemporaryDirectory disk;
  auto server =
      std::make_unique<ServerProcess>(LOCI_LOCID, disk.path(), "tcp://127.0.0.1:0", kOptions);
  const std::string endpoint = server->endpoint();
  const auto channel = client::Channel::Create(endpoint);
  CreateMap(*channel);
  const auto session = OpenSession(channel);
  std::thread robot([&] { StreamAll(*session); });
  RandomSequence random(20260301);
  std::uint64_t recovered_from = 0;
  for (std::uint64_t kill = 0; kill < kKills; ++kill) {
    // Somewhere in each twentieth of the drive, and at any moment of what the server does then.
    const std::uint64_t after = (kill * kDriveLength + random.NextBits() % kDriveLength) / kKills;
    while (session->progress().last_durable_number < after) {
      std::this_thread::yield();
    }
    std::this_thread::sleep_for(std::chrono::microseconds(random.NextBits() % 3000));
    // Every other one in a server that has written a checkpoint.
    std::uint64_t checkpoint = recovered_from;
    while (kill % 2 == 1 && checkpoint == recovered_from &&
           session->progress().last_durable_number < kDriveLength) {
      checkpoint = StatusOf(*channel).last_checkpoint();
    }
    EXPECT_EQ(server->End(SIGKILL), -SIGKILL);
    server = std::make_unique<ServerProcess>(LOCI_LOCID, disk.path(), endpoint, kOptions);
    const v1::ServerStatus::Map status = StatusOf(*channel);
    EXPECT_GE(status.recovered_from() + status.events_replayed(), after + 2);  // 2: made, opened
    EXPECT_GE(status.recovered_from(), checkpoint);
    recovered_from = status.recovered_from();
  }
  robot.join();
  const Outcome outcome = OutcomeOf(*channel);
  EXPECT_EQ(outcome.digest, expected.digest);
  EXPECT_EQ(outcome.trajectory, expected.trajectory);
  EXPECT_GT(recovered_from, kDriveLength / 2);
  v1::VerifyMapRequest verify;
  verify.set_map("hall");
  const auto verified = channel->Call<v1::VerifyMapResponse>("loci.v1.MapAdmin/VerifyMap", verify);
  ASSERT_THAT(verified, IsOk());
  EXPECT_EQ(verified->state_digest(), expected.digest);
  EXPECT_GT(verified->replayed_from(), 0U);
  EXPECT_EQ(server->End(SIGINT), 0);
}

TEST(KillTest, TheServerEndsWithinFiveSecondsWhateverIsGoingOn) {
  const TemporaryDirectory disk;
  ServerProcess server(LOCI_LOCID, disk.path());
  const auto channel = client::Channel::Create(server.endpoint());
  CreateMap(*channel);
  auto options = SessionOptions();
  options.retry_for = std::chrono::milliseconds(0);
  auto session = client::MappingSession::Open(channel, options);
  ASSERT_THAT(session, IsOk());
  std::thread robot([&] {
    for (const ObservationEvent& observation : RoomDrive(3000)) {
      if (!(*session)->Append(MessageOf(observation)).ok()) {
        return;
      }
    }
  });
  v1::VerifyMapRequest verify;
  verify.set_map("hall");
  auto verified = channel->CallFuture<v1::VerifyMapResponse>("loci.v1.MapAdmin/VerifyMap", verify);
  v1::StreamRasterRequest raster;  // a large answer that nobody reads
  raster.set_map("hall");
  raster.set_layer("occupancy");
  raster.mutable_region()->set_x_max_m(2000.0);
  raster.mutable_region()->set_y_max_m(2000.0);
  auto unread = channel->Stream<v1::RasterRows>("loci.v1.MapQuery/StreamRaster", raster);
  while ((*session)->progress().last_durable_number < 300) {  // the server is at work
    std::this_thread::yield();
  }
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(server.End(SIGTERM), 0);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));
  robot.join();
}

}  // namespace
}  // namespace loci
