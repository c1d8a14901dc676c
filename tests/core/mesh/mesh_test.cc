// SPDX-License-Identifier: Apache-2.0
#include "core/mesh/mesh.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "tests/support/mesh_world.h"

namespace loci {
namespace {

using testing::BuildingAt;
using testing::ObserveBuilding;
using testing::SampleMesh;

constexpr double kCellM = 0.1;
constexpr double kRadiusM = 6.0;

// A mesh and the places that it was made of.
class World {
 public:
  World() : mesh_(kCellM) {}

  // Adds a place that sees the building from `map_from_place`, without consolidating it.
  PlaceId AddPlace(const Pose2& map_from_place, double radius_m = kRadiusM) {
    poses_.push_back(map_from_place);
    grids_.push_back(ObserveBuilding(map_from_place, radius_m, kCellM));
    mesh_.MovePlaces(poses_);
    return PlaceId{static_cast<std::uint32_t>(poses_.size() - 1)};
  }
  void Consolidate(PlaceId place) {
    mesh_.Consolidate({place,
                       SessionId{0},
                       std::int64_t{1000} + place.value,
                       &grids_[place.value],
                       nullptr,
                       poses_[place.value]});
  }
  // Places along a line, a third of a footprint apart.
  void DriveAlong(int place_count, const Pose2& start = {}) {
    for (int i = 0; i < place_count; ++i) {
      Consolidate(AddPlace(start * Pose2{4.0 * i, 0.7 * (i % 3), 0.3 * i}));
    }
    FinishWork();
  }
  void FinishWork() {
    int steps = 0;
    while (mesh_.HasWork()) {
      mesh_.Work(1);
      ASSERT_LT(++steps, 5000);
    }
  }
  void Move(const std::vector<Pose2>& poses) {
    poses_ = poses;
    mesh_.MovePlaces(poses_);
  }

  Mesh& mesh() { return mesh_; }
  const std::vector<Pose2>& poses() const { return poses_; }
  const LogOddsGrid& grid(PlaceId place) const { return grids_[place.value]; }

 private:
  Mesh mesh_;
  std::vector<Pose2> poses_;
  std::vector<LogOddsGrid> grids_;
};

Digest DigestOf(const Mesh& mesh) {
  HashArchive archive;
  mesh.AddToHash(archive);
  return archive.Finish();
}

std::vector<StateRecord> AllRecords(const Mesh& mesh) {
  std::vector<StateRecord> written;
  std::vector<std::pair<std::uint32_t, std::uint64_t>> removed;
  mesh.AppendChanges(EventNumber{0}, written, removed);
  EXPECT_TRUE(removed.empty());
  return written;
}

Eigen::Vector2d CentroidOf(const MeshSnapshot& mesh, const LtrSnapshot& ltr, double u, double v) {
  const TriangleInMap triangle{{mesh.vertices_in_map[ltr.vertices[0].value],
                                mesh.vertices_in_map[ltr.vertices[1].value],
                                mesh.vertices_in_map[ltr.vertices[2].value]}};
  return MapFromUv(triangle) * Eigen::Vector2d(u, v);
}

void ExpectNoneTurnedOver(const MeshSnapshot& mesh) {
  for (const LtrSnapshot& ltr : mesh.ltrs) {
    const TriangleInMap triangle{{mesh.vertices_in_map[ltr.vertices[0].value],
                                  mesh.vertices_in_map[ltr.vertices[1].value],
                                  mesh.vertices_in_map[ltr.vertices[2].value]}};
    ASSERT_GT(MapFromUv(triangle).Determinant(), 0.0);
  }
}

// Occupied cells of a raster over a box, and the same dilated by one cell.
struct Raster {
  int width = 0;
  int height = 0;
  std::vector<bool> occupied;
  bool At(int x, int y) const {
    return x >= 0 && y >= 0 && x < width && y < height &&
           occupied[static_cast<std::size_t>(y * width + x)];
  }
  bool Dilated(int x, int y) const {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (At(x + dx, y + dy)) {
          return true;
        }
      }
    }
    return false;
  }
};

// The box from (-4, -4) to (32, 11), in metres.
Raster Draw(const MeshSnapshot& mesh) {
  constexpr double kLow = -4.0;
  Raster raster;
  raster.width = 360;
  raster.height = 150;
  for (int y = 0; y < raster.height; ++y) {
    for (int x = 0; x < raster.width; ++x) {
      const Eigen::Vector2d point(kLow + (x + 0.5) * kCellM, kLow + (y + 0.5) * kCellM);
      raster.occupied.push_back(SampleMesh(mesh, Layer::kOccupancy, point) > 0);
    }
  }
  return raster;
}

double DilatedIou(const Raster& left, const Raster& right) {
  int both = 0;
  int either = 0;
  for (int y = 0; y < left.height; ++y) {
    for (int x = 0; x < left.width; ++x) {
      both += left.Dilated(x, y) && right.Dilated(x, y) ? 1 : 0;
      either += left.Dilated(x, y) || right.Dilated(x, y) ? 1 : 0;
    }
  }
  return either == 0 ? 1.0 : static_cast<double>(both) / either;
}

TEST(MeshTest, EveryObservedCellIsServedAfterConsolidation) {
  for (const Pose2& pose : {Pose2{0, 0, 0}, Pose2{103.3, -57.1, 0.8}, Pose2{-20000, 15000, 2.0}}) {
    World world;
    const PlaceId place = world.AddPlace(pose);
    world.Consolidate(place);
    const auto snapshot = world.mesh().TakeSnapshot();
    const Transformer2 to_map(pose);
    const auto cells = static_cast<std::int32_t>(kRadiusM / kCellM);
    for (std::int32_t y = -cells; y < cells; y += 3) {
      for (std::int32_t x = -cells; x < cells; x += 3) {
        const Eigen::Vector2d centre((x + 0.5) * kCellM, (y + 0.5) * kCellM);
        // Within a cell of the disc's edge the nearest cell may be outside.
        if (centre.norm() < kRadiusM - 2 * kCellM) {
          ASSERT_NE(SampleMesh(*snapshot, Layer::kOccupancy, to_map * centre), kUnobserved);
        }
      }
    }
  }
}

TEST(MeshTest, CellCentresServeThePlacesValues) {
  World world;
  const PlaceId place = world.AddPlace({3.0, 4.0, 0.5});
  world.Consolidate(place);
  const auto snapshot = world.mesh().TakeSnapshot();
  const Transformer2 place_from_map(Inverse(world.poses()[0]));
  std::uint64_t observed = 0;
  for (const LtrSnapshot& ltr : snapshot->ltrs) {
    for (std::int32_t row = 0; row < ltr.occupancy->row_count; ++row) {
      for (std::int32_t column = 0; column < ltr.occupancy->column_count; ++column) {
        const double u = (column + 0.5) / ltr.occupancy->column_count;
        const double v = (row + 0.5) / ltr.occupancy->row_count;
        const LogOdds8 served =
            ltr.occupancy
                ->cells[static_cast<std::size_t>(row * ltr.occupancy->column_count + column)];
        observed += served != kUnobserved ? 1U : 0U;
        if (u + v > 1.0) {
          continue;
        }
        const Eigen::Vector2d point = place_from_map * CentroidOf(*snapshot, ltr, u, v);
        const CellIndex cell{static_cast<std::int32_t>(std::floor(point.x() / kCellM)),
                             static_cast<std::int32_t>(std::floor(point.y() / kCellM))};
        ASSERT_EQ(served, world.grid(place).At(cell));
      }
    }
  }
  EXPECT_EQ(observed, world.mesh().cells_consolidated());
  EXPECT_GT(observed, 11000U);  // pi 6^2 m2 at 100 cells per m2
}

TEST(MeshTest, SeveralPlacesAddUp) {
  World world;
  world.Consolidate(world.AddPlace({0, 0, 0}));
  world.Consolidate(world.AddPlace({0.5, 0, 0}));
  world.FinishWork();
  const auto snapshot = world.mesh().TakeSnapshot();
  EXPECT_EQ(SampleMesh(*snapshot, Layer::kOccupancy, {1.0, 1.0}), -40);
  EXPECT_EQ(SampleMesh(*snapshot, Layer::kOccupancy, {1.05, 0.05}), 80);
  EXPECT_EQ(SampleMesh(*snapshot, Layer::kMoving, {1.0, 1.0}), kUnobserved);
}

TEST(MeshTest, TheMovingLayerIsKeptApart) {
  World world;
  const PlaceId place = world.AddPlace({0, 0, 0});
  LogOddsGrid moving;
  moving.Writable({15, 10}) = 33;
  world.mesh().Consolidate({place, SessionId{0}, 5, &world.grid(place), &moving, {}});
  const auto snapshot = world.mesh().TakeSnapshot();
  EXPECT_EQ(SampleMesh(*snapshot, Layer::kMoving, {1.55, 1.05}), 33);
  EXPECT_EQ(SampleMesh(*snapshot, Layer::kMoving, {1.95, 1.05}), kUnobserved);
  EXPECT_EQ(SampleMesh(*snapshot, Layer::kOccupancy, {1.55, 1.05}), -20);
}

TEST(MeshTest, ADrivenRouteShowsTheBuilding) {
  World world;
  world.DriveAlong(12);
  const auto snapshot = world.mesh().TakeSnapshot();
  ExpectNoneTurnedOver(*snapshot);
  int right = 0;
  int all = 0;
  RandomSequence random(1);
  for (int i = 0; i < 4000; ++i) {
    const Eigen::Vector2d point(random.NextUniform(-2.0, 46.0), random.NextUniform(-3.0, 4.0));
    const LogOdds8 value = SampleMesh(*snapshot, Layer::kOccupancy, point);
    ASSERT_NE(value, kUnobserved);
    ++all;
    right += (value > 0) == (BuildingAt(point) > 0) ? 1 : 0;
  }
  EXPECT_GT(right, all * 96 / 100);  // cells that a wall's edge runs through may go either way
}

TEST(MeshTest, ARigidMotionOfAllPlacesKeepsTexturesAndMovesVerticesWithThem) {
  World world;
  world.DriveAlong(8);
  const auto before = world.mesh().TakeSnapshot();
  const std::uint64_t written = world.mesh().cells_consolidated() + world.mesh().cells_remeshed();
  const Digest digest = DigestOf(world.mesh());
  const Pose2 motion{12.5, -3.25, 0.9};
  std::vector<Pose2> moved;
  for (const Pose2& pose : world.poses()) {
    moved.push_back(motion * pose);
  }
  world.Move(moved);
  EXPECT_EQ(DigestOf(world.mesh()), digest);  // positions belong to the poses
  world.FinishWork();  // the hull may be another one as seen from the super vertices
  const auto after = world.mesh().TakeSnapshot();
  ASSERT_EQ(before->ltrs.size(), after->ltrs.size());
  for (std::size_t i = 0; i < before->ltrs.size(); ++i) {
    EXPECT_EQ(before->ltrs[i].vertices, after->ltrs[i].vertices);
    EXPECT_EQ(before->ltrs[i].occupancy, after->ltrs[i].occupancy);  // shared, not copied
  }
  for (std::size_t i = 0; i < before->vertices_in_map.size(); ++i) {
    EXPECT_LT((after->vertices_in_map[i] - motion * before->vertices_in_map[i]).norm(), 1e-4);
  }
  EXPECT_EQ(world.mesh().cells_consolidated() + world.mesh().cells_remeshed(), written);
}

TEST(MeshTest, MovingPlacesWritesNoCell) {
  World world;
  world.DriveAlong(10);
  const std::uint64_t written = world.mesh().cells_consolidated() + world.mesh().cells_remeshed();
  RandomSequence random(2);
  for (int round = 0; round < 20; ++round) {
    std::vector<Pose2> moved = world.poses();
    for (Pose2& pose : moved) {
      pose.x += random.NextUniform(-3.0, 3.0);
      pose.y += random.NextUniform(-3.0, 3.0);
    }
    world.Move(moved);
    ExpectNoneTurnedOver(*world.mesh().TakeSnapshot());
  }
  EXPECT_EQ(world.mesh().cells_consolidated() + world.mesh().cells_remeshed(), written);
}

TEST(MeshTest, RemeshingKeepsWhatIsSeenToWithinACell) {
  RandomSequence random(3);
  for (int round = 0; round < 2; ++round) {
    World world;
    // Two rows of places: vertices of many hosts among each other.
    for (int i = 0; i < 6; ++i) {
      world.Consolidate(world.AddPlace({4.0 * i, 0.5, 0.4 * i + round}));
      world.Consolidate(world.AddPlace({4.0 * i + 1.0, 7.0, -0.7 * i}));
    }
    world.FinishWork();
    // Bends that a late closure makes: more along the way, none between neighbours in space.
    std::vector<Pose2> moved = world.poses();
    const double bend = random.NextUniform(0.12, 0.2);
    for (Pose2& pose : moved) {
      pose.x *= 1.0 + bend;
      pose.y *= 1.0 - 0.5 * bend;
    }
    world.Move(moved);
    ASSERT_TRUE(world.mesh().HasWork());
    const Raster before = Draw(*world.mesh().TakeSnapshot());
    const std::uint64_t consolidated = world.mesh().cells_consolidated();
    world.FinishWork();
    EXPECT_EQ(world.mesh().cells_consolidated(), consolidated);
    EXPECT_GT(world.mesh().cells_remeshed(), 1000U);
    const auto snapshot = world.mesh().TakeSnapshot();
    ExpectNoneTurnedOver(*snapshot);
    EXPECT_GT(DilatedIou(before, Draw(*snapshot)), 0.95);
  }
}

TEST(MeshTest, NothingIsAddedTwiceWhenTheMeshIsRefined) {
  World world;
  world.Consolidate(world.AddPlace({0, 0, 0}, 7.0));
  const auto before = world.mesh().TakeSnapshot();
  // Beside it, turned: its anchors split triangles that have content.
  world.Consolidate(world.AddPlace({11.0, 1.0, 0.7}, 7.0));
  const auto between = world.mesh().TakeSnapshot();
  world.FinishWork();
  const auto after = world.mesh().TakeSnapshot();
  RandomSequence random(4);
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector2d point(random.NextUniform(-4.0, 4.0), random.NextUniform(-4.0, 4.0));
    if ((point - Eigen::Vector2d(11.0, 1.0)).norm() < 7.5) {
      continue;
    }
    // One place saw this: its values and no multiples, at every moment.
    for (const auto& snapshot : {before, between, after}) {
      const LogOdds8 value = SampleMesh(*snapshot, Layer::kOccupancy, point);
      ASSERT_TRUE(value == 40 || value == -20) << int{value};
    }
  }
}

TEST(MeshTest, ContentGoesWithItsPlacesWhenTheMeshIsTurnedOver) {
  World world;
  world.DriveAlong(4);
  // The route is folded: what was last comes to lie on the other side of what was first.
  const Pose2 before = world.poses()[3];
  std::vector<Pose2> folded = world.poses();
  folded[2].x -= 40.0;
  folded[3].x -= 40.0;
  world.Move(folded);
  ASSERT_TRUE(world.mesh().HasWork());
  ExpectNoneTurnedOver(*world.mesh().TakeSnapshot());
  world.FinishWork();
  const auto snapshot = world.mesh().TakeSnapshot();
  ExpectNoneTurnedOver(*snapshot);
  int all = 0;
  int right = 0;
  RandomSequence random(7);
  while (all < 1000) {
    // What the last place alone saw, away from triangles that all belong to the others.
    const Eigen::Vector2d point(random.NextUniform(14.5, 17.5), random.NextUniform(-3.0, 3.0));
    const Eigen::Vector2d point_in_place = Inverse(before) * point;
    if (point_in_place.norm() < kRadiusM - 2 * kCellM) {
      ++all;
      const LogOdds8 value = SampleMesh(*snapshot, Layer::kOccupancy, folded[3] * point_in_place);
      right += value != kUnobserved && (value > 0) == (BuildingAt(point) > 0) ? 1 : 0;
    }
  }
  EXPECT_GT(right, all * 9 / 10);
}

TEST(MeshTest, StaysWellThroughRandomLife) {
  RandomSequence random(5);
  World world;
  for (int step = 0; step < 60; ++step) {
    if (step % 3 == 0) {
      world.Consolidate(world.AddPlace({random.NextUniform(-25.0, 25.0),
                                        random.NextUniform(-25.0, 25.0),
                                        random.NextUniform(-3.0, 3.0)},
                                       3.0));
    } else {
      std::vector<Pose2> moved = world.poses();
      for (Pose2& pose : moved) {
        pose.x += random.NextUniform(-1.0, 1.0);
        pose.y += random.NextUniform(-1.0, 1.0);
        pose.theta = WrapAngle(pose.theta + random.NextUniform(-0.1, 0.1));
      }
      world.Move(moved);
      if (step % 3 == 2) {
        world.FinishWork();
      }
    }
    ExpectNoneTurnedOver(*world.mesh().TakeSnapshot());
  }
  StatusOr<Mesh> copy = Mesh::FromRecords(kCellM, AllRecords(world.mesh()), world.poses());
  ASSERT_TRUE(copy.ok()) << copy.status().ToString();
  EXPECT_EQ(DigestOf(*copy), DigestOf(world.mesh()));
}

TEST(MeshTest, HostsAreThePlacesWhoseVerticesLieAround) {
  World world;
  EXPECT_TRUE(world.mesh().HostsUnder(ObserveBuilding({}, 2.0, kCellM), {}).empty());
  const PlaceId first = world.AddPlace({0, 0, 0});
  const PlaceId far = world.AddPlace({60.0, 0, 0});
  world.Consolidate(first);
  world.Consolidate(far);
  const LogOddsGrid grid = ObserveBuilding({}, 2.0, kCellM);
  EXPECT_EQ(world.mesh().HostsUnder(grid, {0, 0, 1.0}), std::vector<PlaceId>{first});
  EXPECT_EQ(world.mesh().HostsUnder(grid, {60.0, 1.0, 1.0}), std::vector<PlaceId>{far});
  EXPECT_TRUE(world.mesh().HostsUnder(grid, {0, 90.0, 1.0}).empty());
  EXPECT_TRUE(world.mesh().HostsUnder(LogOddsGrid(), {}).empty());
}

TEST(MeshTest, ContinuesFromItsRecordsAsIfNothingHadHappened) {
  World world;
  world.DriveAlong(5);
  std::vector<Pose2> moved = world.poses();
  for (Pose2& pose : moved) {
    pose.x *= 1.4;
  }
  world.Move(moved);
  world.mesh().Work(2);  // in the middle of its queue
  StatusOr<Mesh> copy = Mesh::FromRecords(kCellM, AllRecords(world.mesh()), world.poses());
  ASSERT_TRUE(copy.ok()) << copy.status().ToString();
  EXPECT_EQ(DigestOf(*copy), DigestOf(world.mesh()));
  const PlaceId next = world.AddPlace({20.0, 5.0, 1.0});
  copy->MovePlaces(world.poses());
  const PlaceContent content{
      next, SessionId{1}, 77, &world.grid(next), nullptr, world.poses()[next.value]};
  for (Mesh* mesh : {&world.mesh(), &*copy}) {
    mesh->Consolidate(content);
    while (mesh->HasWork()) {
      mesh->Work(3);
    }
  }
  EXPECT_EQ(DigestOf(*copy), DigestOf(world.mesh()));
}

TEST(MeshTest, ChangesOfEachEventAddUpToTheWholeState) {
  World world;
  std::vector<StateRecord> stored;
  EventNumber last{0};
  for (std::uint64_t event = 1; event <= 12; ++event) {
    world.mesh().BeginEvent(EventNumber{event});
    if (event % 2 == 1) {
      world.Consolidate(world.AddPlace({5.0 * static_cast<double>(event), 0.0, 0.2}));
    } else {
      world.mesh().Work(2);
    }
    if (event % 3 != 1) {
      continue;
    }
    std::vector<StateRecord> written;
    std::vector<std::pair<std::uint32_t, std::uint64_t>> removed;
    world.mesh().AppendChanges(last, written, removed);
    const auto erase = [&](std::uint32_t kind, std::uint64_t id) {
      return std::erase_if(stored, [&](const StateRecord& record) {
        return record.kind == kind && record.id == id;
      });
    };
    for (const auto& [kind, id] : removed) {
      EXPECT_EQ(erase(kind, id), 1U);  // only what was stored is removed
    }
    for (const StateRecord& record : written) {
      erase(record.kind, record.id);
      stored.push_back(record);
    }
    last = EventNumber{event};
    world.mesh().ForgetChangesUpTo(last);
    StatusOr<Mesh> copy = Mesh::FromRecords(kCellM, stored, world.poses());
    ASSERT_TRUE(copy.ok()) << copy.status().ToString();
    ASSERT_EQ(DigestOf(*copy), DigestOf(world.mesh()));
  }
}

TEST(MeshTest, DamagedRecordsAreRefusedOrReadButNeverCrash) {
  World world;
  world.DriveAlong(3);
  const std::vector<StateRecord> records = AllRecords(world.mesh());
  EXPECT_EQ(Mesh::FromRecords(kCellM, {}, world.poses()).status().code(), StatusCode::kDataLoss);
  EXPECT_EQ(Mesh::FromRecords(kCellM, records, {}).status().code(), StatusCode::kDataLoss);
  RandomSequence random(6);
  for (int round = 0; round < 400; ++round) {
    std::vector<StateRecord> damaged = records;
    std::string& bytes = damaged[random.NextBits() % damaged.size()].bytes;
    if (round % 3 == 0) {
      bytes.resize(random.NextBits() % bytes.size());
    } else {
      // Heads of records hold what is easiest to break.
      const std::size_t range =
          round % 3 == 1 ? std::min<std::size_t>(bytes.size(), 200) : bytes.size();
      bytes[random.NextBits() % range] = static_cast<char>(random.NextBits());
    }
    StatusOr<Mesh> mesh = Mesh::FromRecords(kCellM, damaged, world.poses());
    if (mesh.ok()) {
      mesh->Work(50);
      ExpectNoneTurnedOver(*mesh->TakeSnapshot());
    } else {
      EXPECT_EQ(mesh.status().code(), StatusCode::kDataLoss);
    }
  }
}

TEST(MeshTest, PlacesBeyondTheBorderOfTheMapDoNoHarm) {
  World world;
  world.DriveAlong(2);
  world.Consolidate(world.AddPlace({1e9, -1e9, 0.3}, 2.0));
  world.Consolidate(world.AddPlace({32767.0, 32767.0, 0.3}, 2.0));
  world.FinishWork();
  EXPECT_NE(SampleMesh(*world.mesh().TakeSnapshot(), Layer::kOccupancy, {1.0, 1.0}), kUnobserved);
}

}  // namespace
}  // namespace loci
