// SPDX-License-Identifier: Apache-2.0
// A region that is read tile by tile at one revision, while a robot changes the map.
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loci/v1/map_query.pb.h"
#include "tests/support/matchers.h"
#include "tests/support/programs.h"

namespace loci {
namespace {

constexpr int kZoom = 8;
constexpr double kTileSideM = 12.8;

using Tiles = std::map<std::pair<int, int>, std::string>;  // PNG by x, y

class ConsistentReadTest : public ProgramsTest {
 protected:
  // All tiles of the map, of one revision, over HTTP.
  Tiles TilesByHttp(const nlohmann::json& map) {
    Tiles tiles;
    const auto index = [&](std::size_t bound) {
      return static_cast<int>(std::floor(map["bounds_m"][bound].get<double>() / kTileSideM));
    };
    for (int x = index(0); x <= index(2); ++x) {
      for (int y = index(1); y <= index(3); ++y) {
        const HttpReply reply = HttpGet(server().http_port(),
                                        "/maps/hall/tiles/occupancy/" + std::to_string(kZoom) +
                                            "/" + std::to_string(x) + "/" + std::to_string(y) +
                                            ".png?revision=" + map["revision"].dump());
        EXPECT_EQ(reply.status, 200) << reply.body;
        tiles[{x, y}] = reply.body;
      }
    }
    return tiles;
  }

  // The same as one stream.
  Tiles TilesByStream(std::uint64_t revision) {
    v1::StreamTilesRequest request;
    request.set_map("hall");
    request.set_layer("occupancy");
    request.set_zoom(kZoom);
    request.set_revision(revision);
    auto stream = channel().Stream<v1::Tile>("loci.v1.MapQuery/StreamTiles", request);
    Tiles tiles;
    for (v1::Tile tile; stream.Next(tile);) {
      EXPECT_EQ(tile.revision(), revision);
      tiles[{tile.x(), tile.y()}] = tile.png();
    }
    EXPECT_THAT(stream.status(), IsOk());
    return tiles;
  }
};

TEST_F(ConsistentReadTest, APinnedRegionStaysAsItIsWhileTheMapChanges) {
  const std::string log = WriteOfficeLog(Path("log"), 400);
  StartServer();
  Program stream(Command({"stream", log, "--map", "hall", "--session", "run", "--speed", "60"}));
  std::set<std::uint64_t> revisions;
  std::set<std::string> pictures;  // of all tiles one after the other
  std::uint64_t changed_meanwhile = 0;
  while (!stream.Ends(std::chrono::milliseconds(0)) || revisions.empty()) {
    const HttpReply reply = HttpGet(server().http_port(), "/maps/hall");
    const nlohmann::json map = nlohmann::json::parse(reply.body, nullptr, false);
    if (reply.status != 200 || map["bounds_m"].is_null()) {
      ASSERT_FALSE(stream.Ends(std::chrono::milliseconds(1))) << stream.error();
      continue;
    }
    const std::uint64_t revision = map["revision"];
    const Tiles once = TilesByHttp(map);
    const Tiles again = TilesByHttp(map);
    ASSERT_FALSE(once.empty());
    ASSERT_TRUE(once == again) << "of revision " << revision;
    ASSERT_TRUE(TilesByStream(revision) == once) << "of revision " << revision;
    revisions.insert(revision);
    std::string picture;
    for (const auto& [address, png] : once) {
      picture += png;
    }
    pictures.insert(picture);
    const HttpReply newer = HttpGet(server().http_port(), "/maps/hall");
    changed_meanwhile += nlohmann::json::parse(newer.body)["revision"] > revision ? 1U : 0U;
  }
  EXPECT_EQ(stream.Wait(), 0) << stream.error();
  // Else nothing was proven.
  EXPECT_GT(revisions.size(), 5U);
  EXPECT_GT(pictures.size(), 5U);
  EXPECT_GT(changed_meanwhile, 5U);
}

}  // namespace
}  // namespace loci
