// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/grid_file.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/temporary_directory.h"

namespace loci {
namespace {

using Cell = OccupancyMap::Cell;

OccupancyMap Sample() {
  OccupancyMap map;
  map.x_min_m = -1.25;
  map.y_min_m = 3.4;
  map.resolution_m = 0.05;
  map.width = 3;
  map.height = 2;
  map.cells = {
      Cell::kFree, Cell::kOccupied, Cell::kUnknown, Cell::kFree, Cell::kFree, Cell::kOccupied};
  return map;
}

TEST(GridFileTest, ComesBackAsItWasWritten) {
  const TemporaryDirectory folder;
  for (const char* name : {"a.yaml", "b.pgm", "c"}) {
    ASSERT_THAT(WriteGridFile((folder.path() / name).string(), Sample()), IsOk());
  }
  for (const char* name : {"a.yaml", "b.yaml", "c.yaml"}) {
    const StatusOr<OccupancyMap> map = ReadGridFile((folder.path() / name).string());
    ASSERT_THAT(map, IsOk());
    EXPECT_EQ(map->cells, Sample().cells);
    EXPECT_EQ(map->x_min_m, -1.25);
    EXPECT_EQ(map->y_min_m, 3.4);
    EXPECT_EQ(map->resolution_m, 0.05);
  }
}

TEST(GridFileTest, WritesWhatMapServerReads) {
  const TemporaryDirectory folder;
  ASSERT_THAT(WriteGridFile((folder.path() / "map.yaml").string(), Sample()), IsOk());
  std::ifstream pgm(folder.path() / "map.pgm", std::ios::binary);
  const std::string picture((std::istreambuf_iterator<char>(pgm)),
                            std::istreambuf_iterator<char>());
  // The upper row comes first: free 254, occupied 0, unknown 205.
  EXPECT_EQ(picture, std::string("P5\n3 2\n255\n\xFE\xFE\x00\xFE\x00\xCD", 17));
  std::ifstream yaml(folder.path() / "map.yaml");
  const std::string text((std::istreambuf_iterator<char>(yaml)), std::istreambuf_iterator<char>());
  EXPECT_EQ(text,
            "image: map.pgm\nmode: trinary\nresolution: 0.05\norigin: [-1.25, 3.4, 0.0]\n"
            "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n");
}

TEST(GridFileTest, NamesFileAndFieldOfWhatItCannotRead) {
  const TemporaryDirectory folder;
  const std::string path = (folder.path() / "x.yaml").string();
  const auto read = [&](const std::string& yaml, const std::string& pgm) {
    std::ofstream(path) << yaml;
    std::ofstream(folder.path() / "x.pgm") << pgm;
    return ReadGridFile(path).status();
  };
  const std::string good = "image: x.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n";
  EXPECT_THAT(ReadGridFile("/nowhere/x.yaml"), IsStatus(StatusCode::kNotFound, "/nowhere/x.yaml"));
  EXPECT_THAT(read("image: x.pgm\n", ""), IsStatus(StatusCode::kInvalidArgument, "resolution"));
  EXPECT_THAT(read("image: x.pgm\nresolution: q\norigin: [0, 0, 0]\n", ""),
              IsStatus(StatusCode::kInvalidArgument, "resolution"));
  for (const char* pgm : {"",
                          "P6\n1 1\n255\nxxx",
                          "P5\n",
                          "P5\n2 2\n255\nxx",
                          "P5\n-1 2\n255\nxx",
                          "P5\n99999999 99999999\n255\nxx"}) {
    EXPECT_THAT(read(good, pgm), IsStatus(StatusCode::kInvalidArgument, "x.pgm")) << pgm;
  }
  EXPECT_THAT(read(good, "P5\n# a comment\n1 1\n255\n\x01"), IsOk());
}

}  // namespace
}  // namespace loci
