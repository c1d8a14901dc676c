// SPDX-License-Identifier: Apache-2.0
#include "server/http/map_routes.h"

#include <array>
#include <chrono>
#include <cstdint>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "server/http/http_server.h"
#include "server/http/revision_events.h"
#include "server/http/viewer_files.h"
#include "tests/support/raw_client.h"
#include "tests/support/snapshots.h"

namespace loci {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

Snapshot SmallWorld() {
  testing::WorldOptions options;
  options.place_count = 1;
  return testing::MakeSnapshot(options);
}

RevisionChange DirtyChange(std::vector<TileAddress> tiles) {
  RevisionChange change;
  change.map = "hall";
  change.dirty_tiles = std::move(tiles);
  return change;
}

// Maps whose states and changes a test dictates.
class FakeMaps final : public SnapshotSource {
 public:
  FakeMaps() : snapshot_(std::make_shared<Snapshot>(SmallWorld())) {}

  StatusOr<std::shared_ptr<const Snapshot>> FindSnapshot(const std::string& map,
                                                         Revision revision) const override {
    if (map == "recovering") {
      return UnavailableError("map \"recovering\" is being recovered");
    }
    if (map != "hall" || (revision.value != 0 && revision != snapshot_->revision)) {
      return NotFoundError("map \"" + map + "\" at this revision is not here");
    }
    return std::shared_ptr<const Snapshot>(snapshot_);
  }

  std::vector<MapStatus> Maps() const override {
    MapStatus hall;
    hall.map = "hall";
    hall.state = MapState::kServing;
    hall.newest = snapshot_;
    MapStatus other;
    other.map = "recovering";
    other.state = other_state;
    return {hall, other};
  }

  StatusOr<std::unique_ptr<Subscription>> Subscribe(const std::string& map,
                                                    RevisionCallback callback) override {
    LOCI_RETURN_IF_ERROR(FindSnapshot(map, Revision()).status());
    callback_ = std::move(callback);
    return std::make_unique<Subscription>();
  }

  void Publish(RevisionChange change) {
    snapshot_ = std::make_shared<Snapshot>(*snapshot_);
    ++snapshot_->revision.value;
    change.snapshot = snapshot_;
    callback_(change);
  }

  MapState other_state = MapState::kRecovering;

 private:
  std::shared_ptr<Snapshot> snapshot_;
  RevisionCallback callback_;
};

class MapRoutesTest : public ::testing::Test {
 protected:
  MapRoutesTest()
      : routes_(
            maps_,
            metrics_,
            [](const std::shared_ptr<const Snapshot>& snapshot,
               Layer layer,
               const TileAddress& address) {
              return std::make_shared<const std::string>("png of " + std::string(LayerName(layer)) +
                                                         " " + std::to_string(address.x) + " at " +
                                                         std::to_string(snapshot->revision.value));
            },
            ViewerFiles()) {
    HttpServerOptions options;
    options.event_interval = std::chrono::milliseconds(1);
    server_ = HttpServer::Start(
                  options,
                  [this](const HttpRequest& request) { return routes_.Answer(request); },
                  metrics_)
                  .value();
  }

  std::string Get(const std::string& target, const std::string& headers = "") {
    RawClient client(server_->port());
    client.Send("GET " + target + " HTTP/1.1\r\nHost: x\r\n" + headers + "\r\n");
    return client.ReadAnswer();
  }

  FakeMaps maps_;
  MetricRegistry metrics_;
  MapRoutes routes_;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(MapRoutesTest, ATileNamesItsRevisionAndIsNotSentTwice) {
  const std::string answer = Get("/maps/hall/tiles/occupancy/8/-3/2.png");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(answer, HasSubstr("Content-Type: image/png\r\n"));
  EXPECT_THAT(answer, HasSubstr("Loci-Revision: 7\r\n"));
  EXPECT_THAT(answer, EndsWith("png of occupancy -3 at 7"));
  const std::size_t begin = answer.find("ETag: ") + 6;
  const std::string etag = answer.substr(begin, answer.find('\r', begin) - begin);
  EXPECT_THAT(
      Get("/maps/hall/tiles/occupancy/8/-3/2.png?revision=7", "If-None-Match: " + etag + "\r\n"),
      StartsWith("HTTP/1.1 304 "));
  EXPECT_THAT(Get("/maps/hall/tiles/occupancy/8/4/2.png", "If-None-Match: " + etag + "\r\n"),
              StartsWith("HTTP/1.1 200 "));
}

TEST_F(MapRoutesTest, EveryBadPathIsToldWhatIsWrong) {
  const std::string tile = "/maps/hall/tiles/occupancy/";
  const std::vector<std::array<std::string, 3>> cases = {
      {tile + "25/0/0.png", "400", "z:"},
      {tile + "-1/0/0.png", "400", "z:"},
      {tile + "8/16777216/0.png", "400", "x"},
      {tile + "8/0/-16777216.png", "400", "y"},
      {tile + "8/99999999999999999999/0.png", "400", "x"},
      {tile + "8/0x1/0.png", "400", "x"},
      {tile + "8/1e3/0.png", "400", "x"},
      {tile + "8/%2b1/0.png", "400", "x"},
      {tile + "8/0/0.jpg", "400", ".png"},
      {tile + "8/0/.png", "400", "y"},
      {tile + "8/0/0.png?revision=-1", "400", "revision"},
      {tile + "8/0/0.png?revision=", "400", "revision"},
      {tile + "8/0/0.png?v=1", "400", "query"},
      {tile + "8/0/0.png?revision=3", "404", "revision"},
      {"/maps/hall/tiles/salt/8/0/0.png", "404", "layer"},
      {"/maps/nowhere/tiles/occupancy/8/0/0.png", "404", "nowhere"},
      {"/maps/recovering/tiles/occupancy/8/0/0.png", "503", "recovered"},
      {"/maps/Hall", "400", "map"},
      {"/maps/..%2f..%2fetc%2fpasswd", "400", "map"},
      {"/maps/hall/../../../etc/passwd", "400", "path"},
      {"/maps/hall/%2e%2e/x", "400", "path"},
      {"/maps/" + std::string(65, 'a'), "400", "map"},
      {"/maps//tiles", "400", "map"},
      {"/maps/hall/tiles/occupancy/8/0", "404", "path"},
      {"/nothing", "404", "path"},
      {"/etc/passwd", "404", "path"},
  };
  for (const auto& [target, status, message] : cases) {
    const std::string answer = Get(target);
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 " + status + " ")) << target;
    EXPECT_THAT(answer.substr(answer.find("\r\n\r\n")), HasSubstr(message)) << target;
  }
}

TEST_F(MapRoutesTest, DescribesMaps) {
  EXPECT_THAT(Get("/maps"),
              EndsWith("{\"maps\":["
                       "{\"map\":\"hall\",\"problem\":\"\",\"revision\":7,\"state\":\"serving\"},"
                       "{\"map\":\"recovering\",\"problem\":\"\",\"revision\":0,"
                       "\"state\":\"recovering\"}]}\n"));
  const std::string hall = Get("/maps/hall");
  EXPECT_THAT(hall, HasSubstr("\"layers\":[\"occupancy\",\"moving\"]"));
  EXPECT_THAT(hall, HasSubstr("\"revision\":7"));
  EXPECT_THAT(hall, HasSubstr("\"zoom_max\":9"));
  EXPECT_THAT(hall, HasSubstr("\"bounds_m\":[-"));
}

TEST_F(MapRoutesTest, IsAliveAtOnceAndReadyWhenAllIsRecovered) {
  EXPECT_THAT(Get("/healthz"), StartsWith("HTTP/1.1 200 "));
  const std::string waiting = Get("/readyz");
  EXPECT_THAT(waiting, StartsWith("HTTP/1.1 503 "));
  EXPECT_THAT(waiting, HasSubstr("recovering: recovering"));
}

TEST_F(MapRoutesTest, ARefusedMapDoesNotKeepTheServerFromBeingReady) {
  maps_.other_state = MapState::kRefused;
  EXPECT_THAT(Get("/readyz"), StartsWith("HTTP/1.1 200 "));
}

TEST_F(MapRoutesTest, SaysItsMetrics) {
  metrics_.AddCounter("some_total", "Some.").Add(5);
  const std::string answer = Get("/metrics");
  EXPECT_THAT(answer, HasSubstr("Content-Type: text/plain; version=0.0.4"));
  EXPECT_THAT(answer, HasSubstr("some_total 5\n"));
}

TEST_F(MapRoutesTest, TheViewerPageNeedsNothingFromElsewhere) {
  const std::string page = Get("/");
  EXPECT_THAT(page, StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(page, HasSubstr("Content-Type: text/html\r\n"));
  EXPECT_THAT(page, HasSubstr("default-src 'self'"));
  for (const std::string& file : {std::string("/viewer.js"), std::string("/viewer.css")}) {
    EXPECT_THAT(page, HasSubstr('"' + file.substr(1) + '"'));
    EXPECT_THAT(Get(file), StartsWith("HTTP/1.1 200 ")) << file;
  }
  for (const StaticFile& file : ViewerFiles()) {
    EXPECT_EQ(file.content.find("://"), std::string_view::npos) << file.path;
  }
}

TEST_F(MapRoutesTest, EventsBeginWithTheNewestRevisionAndGoOnWithEachChange) {
  RawClient viewer(server_->port());
  viewer.Send("GET /maps/hall/events HTTP/1.1\r\nHost: x\r\n\r\n");
  viewer.ReadUntil("\r\n\r\n");
  EXPECT_EQ(viewer.ReadUntil("\n\n"),
            "id: 7\nevent: revision\n"
            "data: {\"dirty_tiles\":[],\"everything_moved\":true,\"revision\":7,"
            "\"tile_zoom\":8}\n\n");
  maps_.Publish(DirtyChange({{8, 0, -1}, {8, 2, 3}}));
  EXPECT_EQ(viewer.ReadUntil("\n\n"),
            "id: 8\nevent: revision\n"
            "data: {\"dirty_tiles\":[[0,-1],[2,3]],\"everything_moved\":false,\"revision\":8,"
            "\"tile_zoom\":8}\n\n");
  RevisionChange end;
  end.ended = true;
  maps_.Publish(end);
  EXPECT_EQ(viewer.ReadUntil("\n\n"), "event: ended\ndata: {}\n\n");
}

TEST_F(MapRoutesTest, EventsOfAnUnknownMapAreNotFound) {
  EXPECT_THAT(Get("/maps/nowhere/events"), StartsWith("HTTP/1.1 404 "));
}

TEST_F(MapRoutesTest, RandomPathsGetAnAnswerOfTheFourHundreds) {
  RandomSequence random(4711);
  const std::string pieces[] = {"maps",
                                "hall",
                                "tiles",
                                "occupancy",
                                "..",
                                "%2e%2e",
                                "%00",
                                "8",
                                "-1",
                                "1.png",
                                "/",
                                "%",
                                "?",
                                "revision="};
  for (int round = 0; round < 300; ++round) {
    std::string target = "/nothing/";
    for (std::uint64_t i = random.NextBits() % 12; i > 0; --i) {
      target += pieces[random.NextBits() % std::size(pieces)];
      target += random.NextBits() % 2 == 0 ? "/" : "";
    }
    EXPECT_THAT(Get(target), StartsWith("HTTP/1.1 4")) << target;
  }
}

TEST(RevisionEventsTest, WhatASlowViewerMissedIsMerged) {
  FakeMaps maps;
  int wakes = 0;
  std::unique_ptr<HttpEventSource> events =
      OpenRevisionEvents(maps, "hall", [&] { ++wakes; }).value();
  events->Take();
  EXPECT_EQ(events->Take(), "");
  maps.Publish(DirtyChange({{8, 1, 1}}));
  maps.Publish(DirtyChange({{8, 0, 0}, {8, 1, 1}}));
  EXPECT_EQ(wakes, 2);
  EXPECT_THAT(events->Take(),
              HasSubstr("\"dirty_tiles\":[[0,0],[1,1]],\"everything_moved\":false"));
  maps.Publish(DirtyChange({{8, 1, 1}}));
  RevisionChange closure;
  closure.everything_moved = true;
  maps.Publish(closure);
  EXPECT_THAT(events->Take(), HasSubstr("\"dirty_tiles\":[],\"everything_moved\":true"));
}

TEST(RevisionEventsTest, TooManyDirtyTilesBecomeAll) {
  FakeMaps maps;
  std::unique_ptr<HttpEventSource> events = OpenRevisionEvents(maps, "hall", [] {}).value();
  events->Take();
  std::vector<TileAddress> tiles;
  for (int i = 0; i < 5000; ++i) {
    tiles.push_back({8, i, 0});
  }
  maps.Publish(DirtyChange(tiles));
  EXPECT_THAT(events->Take(), HasSubstr("\"dirty_tiles\":[],\"everything_moved\":true"));
}

}  // namespace
}  // namespace loci
