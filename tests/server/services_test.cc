// SPDX-License-Identifier: Apache-2.0
// The services over the wire, against a whole server.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <future>
#include <map>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loci/v1/map_query.pb.h"
#include "loci/v1/watch.pb.h"
#include "tests/support/matchers.h"
#include "tests/support/observation_messages.h"
#include "tests/support/room_drive.h"
#include "tests/support/test_server.h"

namespace loci {
namespace {

constexpr std::size_t kDriveLength = 400;

class ServicesTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_THAT(server_.CreateMap("hall"), IsOk());
    ASSERT_THAT(server_.OpenSession("hall", "s"), IsOk());
  }

  void Append(std::size_t begin, std::size_t end) {
    ASSERT_THAT(server_.Call<v1::AppendBatchResponse>("Mapping/AppendBatch",
                                                      BatchOf("hall", "s", drive_, begin, end)),
                IsOk());
  }
  StatusOr<v1::SessionState> Close() {
    v1::CloseSessionRequest request;
    request.set_map("hall");
    request.set_session("s");
    return server_.Call<v1::SessionState>("Mapping/CloseSession", request);
  }

  template <typename Response, typename Request>
  std::vector<Response> ReadAll(const std::string& method, const Request& request) {
    auto stream = server_.channel().Stream<Response>("loci.v1." + method, request);
    std::vector<Response> messages;
    Response message;
    while (stream.Next(message)) {
      messages.push_back(message);
    }
    EXPECT_THAT(stream.status(), IsOk());
    return messages;
  }
  std::vector<v1::Tile> AllTiles(std::uint32_t zoom, std::uint64_t revision) {
    v1::StreamTilesRequest request;
    request.set_map("hall");
    request.set_layer("occupancy");
    request.set_zoom(zoom);
    request.set_revision(revision);
    return ReadAll<v1::Tile>("MapQuery/StreamTiles", request);
  }

  const std::vector<ObservationEvent> drive_ = RoomDrive(kDriveLength);
  TestServer server_;
};

TEST_F(ServicesTest, ARegionReadTileByTileAtAPinnedRevisionIsConsistentWhileWritesGoOn) {
  Append(0, 40);
  ASSERT_THAT(server_.Info("hall"), IsOk());  // what is durable now is applied
  std::atomic<bool> written{false};
  std::jthread robot([&] {
    for (std::size_t begin = 40; begin < kDriveLength; begin += 10) {
      Append(begin, begin + 10);
    }
    written = true;
  });
  std::vector<std::uint64_t> revisions;
  for (bool last = false; !last;) {
    last = written;
    const std::vector<v1::Tile> tiles = AllTiles(9, 0);
    ASSERT_FALSE(tiles.empty());
    revisions.push_back(tiles[0].revision());
    for (const v1::Tile& tile : tiles) {
      ASSERT_EQ(tile.revision(), revisions.back());
    }
    for (const v1::Tile& tile : tiles) {
      v1::GetTileRequest request;
      request.set_map("hall");
      request.set_layer("occupancy");
      request.set_zoom(9);
      request.set_x(tile.x());
      request.set_y(tile.y());
      request.set_revision(revisions.back());
      const StatusOr<v1::Tile> again = server_.Call<v1::Tile>("MapQuery/GetTile", request);
      ASSERT_THAT(again, IsOk());
      EXPECT_EQ(again->revision(), revisions.back());
      EXPECT_EQ(again->png(), tile.png());
    }
  }
  EXPECT_TRUE(std::is_sorted(revisions.begin(), revisions.end()));
}

TEST_F(ServicesTest, AClosedSessionIsInEveryAnswerThatFollows) {
  Append(0, kDriveLength);
  const StatusOr<v1::SessionState> closed = Close();
  ASSERT_THAT(closed, IsOk());
  EXPECT_FALSE(closed->open());
  EXPECT_EQ(closed->last_applied_number(), kDriveLength);
  EXPECT_EQ(closed->accepted_count(), kDriveLength);
  EXPECT_EQ(Close()->revision(), closed->revision());

  const StatusOr<v1::MapInfo> info = server_.Info("hall");
  ASSERT_THAT(info, IsOk());
  EXPECT_EQ(info->last_event(), kDriveLength + 3);
  EXPECT_EQ(info->revision(), info->last_event());
  EXPECT_EQ(info->sessions(), 1U);
  EXPECT_GT(info->places(), 0U);
  EXPECT_GT(info->file_bytes().total(), 0U);
  EXPECT_EQ(info->settings().cell_size_m(), 0.05);

  v1::StreamTrajectoryRequest trajectory;
  trajectory.set_map("hall");
  std::int64_t last_stamp_ns = 0;
  std::size_t count = 0;
  for (const auto& message :
       ReadAll<v1::TrajectoryPoses>("MapQuery/StreamTrajectory", trajectory)) {
    EXPECT_EQ(message.revision(), info->revision());
    for (const v1::StampedPose& pose : message.poses()) {
      EXPECT_GT(pose.stamp_ns(), last_stamp_ns);
      last_stamp_ns = pose.stamp_ns();
      ++count;
    }
  }
  EXPECT_EQ(count, kDriveLength);

  v1::GetGraphRequest graph_request;
  graph_request.set_map("hall");
  const auto graph = server_.Call<v1::Graph>("MapQuery/GetGraph", graph_request);
  ASSERT_THAT(graph, IsOk());
  EXPECT_EQ(static_cast<std::uint64_t>(graph->nodes_size()), info->places());
  v1::GetMeshRequest mesh_request;
  mesh_request.set_map("hall");
  const auto mesh = server_.Call<v1::Mesh>("MapQuery/GetMesh", mesh_request);
  ASSERT_THAT(mesh, IsOk());
  v1::ListClosuresRequest closures_request;
  closures_request.set_map("hall");
  const auto closures =
      server_.Call<v1::ListClosuresResponse>("MapAdmin/ListClosures", closures_request);
  ASSERT_THAT(closures, IsOk());
  EXPECT_EQ(closures->revision(), info->revision());
  EXPECT_EQ(static_cast<std::uint64_t>(mesh->ltr_vertices_size()), 3 * info->ltrs());
}

TEST_F(ServicesTest, ARasterComesInStripsThatMakeOnePictureOfTheRoom) {
  Append(0, kDriveLength);
  ASSERT_THAT(Close(), IsOk());
  v1::StreamRasterRequest request;
  request.set_map("hall");
  request.set_layer("occupancy");
  request.set_resolution_m(0.005);  // fine enough for several strips
  request.mutable_region()->set_x_min_m(-8.0);
  request.mutable_region()->set_x_max_m(8.0);
  request.mutable_region()->set_y_min_m(-8.0);
  request.mutable_region()->set_y_max_m(8.0);
  std::uint32_t next_row = 0;
  std::size_t occupied = 0;
  const auto strips = ReadAll<v1::RasterRows>("MapQuery/StreamRaster", request);
  ASSERT_GT(strips.size(), 1U);
  for (const v1::RasterRows& strip : strips) {
    EXPECT_EQ(strip.revision(), strips[0].revision());
    EXPECT_EQ(strip.first_row(), next_row);
    EXPECT_LT(strip.ByteSizeLong(), std::size_t{1} << 20U);
    ASSERT_EQ(strip.cells().size() % strip.width(), 0U);
    next_row += static_cast<std::uint32_t>(strip.cells().size() / strip.width());
    occupied += static_cast<std::size_t>(
        std::count_if(strip.cells().begin(), strip.cells().end(), [](char cell) {
          return static_cast<signed char>(cell) > 0;
        }));
  }
  EXPECT_EQ(next_row, strips[0].height());
  EXPECT_GT(occupied, 1000U);
}

TEST_F(ServicesTest, AWatcherIsToldTheNewestStateThenEveryChangeThenTheEnd) {
  v1::WatchMapRequest request;
  request.set_map("hall");
  auto stream = server_.channel().Stream<v1::MapChange>("loci.v1.Watch/WatchMap", request);
  v1::MapChange change;
  ASSERT_TRUE(stream.Next(change));
  EXPECT_TRUE(change.everything_moved());
  std::uint64_t revision = change.revision();
  Append(0, 60);
  ASSERT_THAT(Close(), IsOk());
  std::size_t dirty = 0;
  while (revision < 63) {
    ASSERT_TRUE(stream.Next(change));
    EXPECT_GT(change.revision(), revision);
    revision = change.revision();
    dirty += static_cast<std::size_t>(change.dirty_tiles_size());
    ASSERT_EQ(change.sessions_size(), 1);
    EXPECT_EQ(change.sessions(0).session(), "s");
  }
  EXPECT_FALSE(change.sessions(0).open());
  EXPECT_GT(dirty, 0U);
  v1::DeleteMapRequest deleted;
  deleted.set_map("hall");
  ASSERT_THAT(server_.Call<v1::DeleteMapResponse>("MapAdmin/DeleteMap", deleted), IsOk());
  EXPECT_FALSE(stream.Next(change));
  EXPECT_THAT(stream.status(), IsStatus(StatusCode::kUnavailable, "deleted"));
}

TEST_F(ServicesTest, WatchersThatComeAndGoHoldUpNeitherTheWriterNorTheStop) {
  const auto watch = [channel = server_.shared_channel()] {
    v1::WatchMapRequest request;
    request.set_map("hall");
    Status status;
    for (int read = 0; status.code() != StatusCode::kUnavailable; ++read) {
      auto stream = channel->Stream<v1::MapChange>("loci.v1.Watch/WatchMap", request);
      v1::MapChange change;
      // Some leave at once, some after a few changes, some stay to the end.
      for (int left = read % 7 == 6 ? 1000 : read % 7; left > 0 && stream.Next(change); --left) {
      }
      status = channel
                   ->Call<v1::ServerStatus>("loci.v1.MapAdmin/GetServerStatus",
                                            v1::GetServerStatusRequest())
                   .status();
    }
  };
  const std::jthread one(watch);
  const std::jthread other(watch);
  for (std::size_t begin = 0; begin < 200; ++begin) {
    Append(begin, begin + 1);
  }
  server_.Stop();
}

TEST_F(ServicesTest, AMapIsVerifiedWhileItIsServedAndAfterARestart) {
  Append(0, 100);
  ASSERT_THAT(Close(), IsOk());
  v1::VerifyMapRequest request;
  request.set_map("hall");
  const auto verified = server_.Call<v1::VerifyMapResponse>("MapAdmin/VerifyMap", request);
  ASSERT_THAT(verified, IsOk());
  EXPECT_EQ(verified->events_replayed(), 103U);
  const std::string digest = server_.Info("hall")->state_digest();
  EXPECT_EQ(verified->state_digest(), digest);
  server_.Stop();
  server_.Start();
  StatusOr<v1::MapInfo> info = server_.Info("hall");
  while (info.status().code() == StatusCode::kUnavailable) {  // recovering
    info = server_.Info("hall");
  }
  ASSERT_THAT(info, IsOk());
  EXPECT_EQ(info->state_digest(), digest);
}

TEST_F(ServicesTest, ReadsGoOnWhileMoreVerificationsRunThanThereAreWorkers) {
  constexpr std::size_t kVerifications = 8;
  Append(0, kDriveLength);
  ASSERT_THAT(Close(), IsOk());
  server_.Stop();
  server_.options().limits.verifications_at_once = kVerifications;
  server_.Start();
  while (server_.Info("hall").status().code() == StatusCode::kUnavailable) {  // recovering
  }
  v1::VerifyMapRequest request;
  request.set_map("hall");
  std::vector<std::future<StatusOr<v1::VerifyMapResponse>>> verifications;
  for (std::size_t i = 0; i < kVerifications; ++i) {
    verifications.push_back(
        server_.channel().CallFuture<v1::VerifyMapResponse>("loci.v1.MapAdmin/VerifyMap", request));
  }
  // While as many run as there are workers: a read that waits for them would come after.
  const auto two_run = [&verifications] {
    return std::count_if(verifications.begin(), verifications.end(), [](const auto& one) {
             return one.wait_for(std::chrono::seconds(0)) != std::future_status::ready;
           }) >= 2;
  };
  v1::GetTileRequest tile;
  tile.set_map("hall");
  tile.set_layer("occupancy");
  tile.set_zoom(10);
  int reads = 0;
  while (two_run()) {
    ASSERT_THAT(server_.Call<v1::Tile>("MapQuery/GetTile", tile), IsOk());
    reads += two_run() ? 1 : 0;
  }
  EXPECT_GT(reads, 0);
  for (auto& verification : verifications) {
    EXPECT_THAT(verification.get(), IsOk());
  }
}

TEST_F(ServicesTest, AVerificationMoreThanMayRunIsRefusedAndSaysSo) {
  Append(0, kDriveLength);
  ASSERT_THAT(Close(), IsOk());
  v1::VerifyMapRequest request;
  request.set_map("hall");
  std::vector<std::future<StatusOr<v1::VerifyMapResponse>>> asked_at_once;
  for (int i = 0; i < 8; ++i) {
    asked_at_once.push_back(
        server_.channel().CallFuture<v1::VerifyMapResponse>("loci.v1.MapAdmin/VerifyMap", request));
  }
  int done = 0;
  for (auto& asked : asked_at_once) {
    const StatusOr<v1::VerifyMapResponse> answer = asked.get();
    done += answer.ok() ? 1 : 0;
    if (!answer.ok()) {
      EXPECT_THAT(answer, IsStatus(StatusCode::kResourceExhausted, "verifications: 1 run"));
    }
  }
  EXPECT_GE(done, 1);
  EXPECT_LT(done, 8);
}

TEST_F(ServicesTest, TheStatusNamesEveryMapAndCountsItsCells) {
  ASSERT_THAT(server_.CreateMap("yard"), IsOk());
  Append(0, 100);
  ASSERT_THAT(Close(), IsOk());
  v1::GetServerStatusRequest request;
  auto status = server_.Call<v1::ServerStatus>("MapAdmin/GetServerStatus", request);
  ASSERT_THAT(status, IsOk());
  EXPECT_TRUE(status->ready());
  EXPECT_EQ(status->version(), "test");
  ASSERT_EQ(status->maps_size(), 2);
  EXPECT_EQ(status->maps(0).map(), "hall");
  EXPECT_EQ(status->maps(0).problem(), "");
  EXPECT_EQ(status->maps(0).revision(), 103U);
  EXPECT_GT(status->maps(0).cells_written().integrate(), 0U);
  EXPECT_EQ(status->maps(0).cells_written().closure(), 0U);
  request.set_map("yard");
  status = server_.Call<v1::ServerStatus>("MapAdmin/GetServerStatus", request);
  ASSERT_THAT(status, IsOk());
  ASSERT_EQ(status->maps_size(), 1);
  EXPECT_EQ(status->maps(0).map(), "yard");
  request.set_map("cellar");
  EXPECT_THAT(server_.Call<v1::ServerStatus>("MapAdmin/GetServerStatus", request),
              IsStatus(StatusCode::kNotFound, "cellar"));
}

}  // namespace
}  // namespace loci
