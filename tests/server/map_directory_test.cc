// SPDX-License-Identifier: Apache-2.0
#include "server/map_directory.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/hosted_maps.h"
#include "tests/support/matchers.h"
#include "tests/support/room_drive.h"

namespace loci {
namespace {

using ::testing::HasSubstr;

// Overwrites the middle of the map's main file.
void DamageFile(const std::filesystem::path& directory, const std::string& map) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(directory)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_regular_file() && name.starts_with(map + ".") && !name.ends_with("-wal") &&
        !name.ends_with("-shm")) {
      std::fstream file(entry.path(), std::ios::binary | std::ios::in | std::ios::out);
      const auto size = static_cast<std::streamoff>(std::filesystem::file_size(entry.path()));
      for (std::streamoff at = 0; at < size; at += 512) {
        file.seekp(at);
        file.write("damaged!", 8);
      }
    }
  }
}

TEST(MapDirectoryTest, MakesListsAndDeletesMaps) {
  HostedMaps maps;
  EXPECT_THAT(maps->Create("hall", {}), IsOk());
  EXPECT_THAT(maps->Create("hall", {}), IsStatus(StatusCode::kAlreadyExists, "hall"));
  EXPECT_THAT(maps->Create("Hall", {}), IsStatus(StatusCode::kInvalidArgument, "map"));
  EXPECT_THAT(maps->Create("../hall", {}), IsStatus(StatusCode::kInvalidArgument, "map"));
  MapSettings settings;
  settings.cell_size_m = 0.0;
  EXPECT_THAT(maps->Create("yard", settings),
              IsStatus(StatusCode::kInvalidArgument, "settings.cell_size_m"));
  settings.cell_size_m = 0.1;
  EXPECT_THAT(maps->Create("yard", settings), IsOk());
  ASSERT_EQ(maps->Maps().size(), 2U);
  EXPECT_EQ(maps.Info("yard")->settings.cell_size_m, 0.1);
  EXPECT_THAT(maps->Delete("hall"), IsOk());
  EXPECT_THAT(maps->Delete("hall"), IsStatus(StatusCode::kNotFound, "hall"));
  EXPECT_THAT(maps->FindSnapshot("hall", Revision{}), IsStatus(StatusCode::kNotFound, "hall"));
  maps.Restart(StopMode::kAbandon);
  ASSERT_EQ(maps->Maps().size(), 1U);
  EXPECT_EQ(maps->Maps()[0].map, "yard");
  EXPECT_THAT(maps->Create("hall", {}), IsOk());
}

TEST(MapDirectoryTest, ADamagedMapIsRefusedAndTheOthersAreServed) {
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(30);
  for (const std::string map : {"good", "bad"}) {
    ASSERT_THAT(maps->Create(map, {}), IsOk());
    ASSERT_THAT(maps.OpenSession(map, "s"), IsOk());
    ASSERT_THAT(maps.Append(map, "s", drive, 0, 30), IsOk());
  }
  maps.Stop(StopMode::kCheckpoint);
  DamageFile(maps.path(), "bad");
  maps.Start();
  EXPECT_THAT(maps.Host("bad")->WaitUntilServing(), IsStatus(StatusCode::kDataLoss, "bad"));
  EXPECT_THAT(maps.Info("bad"), IsStatus(StatusCode::kDataLoss));
  EXPECT_THAT(maps.Append("bad", "s", drive, 0, 1), IsStatus(StatusCode::kDataLoss));
  EXPECT_THAT(maps->FindSnapshot("bad", Revision{}), IsStatus(StatusCode::kDataLoss));
  EXPECT_THAT(maps.Info("good"), IsOk());
  for (const MapStatus& status : maps->Maps()) {
    EXPECT_EQ(status.state, status.map == "good" ? MapState::kServing : MapState::kRefused);
    EXPECT_EQ(status.problem.empty(), status.map == "good");
  }
  EXPECT_THAT(maps->Delete("bad"), IsOk());
  EXPECT_THAT(maps->Create("bad", {}), IsOk());
}

TEST(MapDirectoryTest, AMapWhoseCreationWasCutShortCanBeMadeAgain) {
  HostedMaps maps;
  maps.Stop(StopMode::kAbandon);
  {
    auto store = OpenSqliteDirectory(maps.path());
    ASSERT_THAT(store, IsOk());
    ASSERT_THAT((*store)->Create("half"), IsOk());
  }
  maps.Start();
  EXPECT_THAT(maps.Info("half"), IsStatus(StatusCode::kNotFound, "cut short"));
  EXPECT_THAT(maps->Create("half", {}), IsOk());
  EXPECT_THAT(maps.Info("half"), IsOk());
}

TEST(MapDirectoryTest, TheNumberOfMapsIsBounded) {
  TemporaryDirectory disk;
  auto store = OpenSqliteDirectory(disk.path());
  ASSERT_THAT(store, IsOk());
  ServerLimits limits;
  limits.maps_max = 2;
  SteadyClock clock;
  auto maps = MapDirectory::Open(std::move(store).value(), limits, clock);
  ASSERT_THAT(maps, IsOk());
  EXPECT_THAT((*maps)->Create("a", {}), IsOk());
  EXPECT_THAT((*maps)->Create("b", {}), IsOk());
  EXPECT_THAT((*maps)->Create("c", {}), IsStatus(StatusCode::kResourceExhausted, "limit"));
}

TEST(MapDirectoryTest, SubscribersHearOfEveryPublishedChangeAndOfTheEnd) {
  HostedMaps maps;
  const std::vector<ObservationEvent> drive = RoomDrive(30);
  ASSERT_THAT(maps->Create("a", {}), IsOk());
  ASSERT_THAT(maps.OpenSession("a", "s"), IsOk());
  std::vector<RevisionChange> changes;  // read after the map has ended
  auto subscription =
      maps->Subscribe("a", [&](const RevisionChange& change) { changes.push_back(change); });
  ASSERT_THAT(subscription, IsOk());
  ASSERT_THAT(maps.Append("a", "s", drive, 0, 30), IsOk());
  ASSERT_THAT(maps.CloseSession("a", "s"), IsOk());
  ASSERT_THAT(maps->Delete("a"), IsOk());
  ASSERT_GE(changes.size(), 2U);
  EXPECT_TRUE(changes.back().ended);
  const RevisionChange& last = changes[changes.size() - 2];
  EXPECT_EQ(last.snapshot->revision.value, 33U);
  EXPECT_EQ(last.sessions.size(), 1U);
  bool any_dirty = false;
  for (std::size_t i = 0; i < changes.size(); ++i) {
    any_dirty = any_dirty || !changes[i].dirty_tiles.empty() || changes[i].everything_moved;
    if (i > 0 && !changes[i].ended) {
      EXPECT_GT(changes[i].snapshot->revision, changes[i - 1].snapshot->revision);
    }
  }
  EXPECT_TRUE(any_dirty);
}

}  // namespace
}  // namespace loci
