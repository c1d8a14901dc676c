// SPDX-License-Identifier: Apache-2.0
#include "core/tile/tile_renderer.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/tile/rasterizer.h"
#include "core/tile/span.h"
#include "tests/support/snapshots.h"

namespace loci {
namespace {

using testing::MakeSnapshot;
using testing::WorldOptions;

// What a point shows, in the plain way and in double.
LogOdds8 SampleSnapshot(const Snapshot& snapshot, Layer layer, const Eigen::Vector2d& point) {
  LogOdds8 value = testing::SampleMesh(*snapshot.mesh, layer, point);
  for (const OverlaySnapshot& overlay : snapshot.overlays) {
    const Eigen::Vector2d at = Inverse(snapshot.places[overlay.place.value].map_from_place) * point;
    const double cell_m = snapshot.settings.cell_size_m;
    const CellIndex cell{static_cast<std::int32_t>(std::floor(at.x() / cell_m)),
                         static_cast<std::int32_t>(std::floor(at.y() / cell_m))};
    value = AddLogOdds(value,
                       (layer == Layer::kOccupancy ? overlay.stationary : overlay.moving).At(cell));
  }
  return value;
}

double FractionThatDiffers(const Snapshot& snapshot, Layer layer, const TileAddress& address) {
  const TileImage tile = RenderTile(snapshot, layer, address);
  const BoxInMap box = BoxOf(address);
  const double pixel_m = PixelSideM(address.zoom);
  int different = 0;
  int observed = 0;
  for (int row = 0; row < kTileSide; ++row) {
    for (int column = 0; column < kTileSide; ++column) {
      const Eigen::Vector2d centre(box.min.x() + (column + 0.5) * pixel_m,
                                   box.max.y() - (row + 0.5) * pixel_m);
      const LogOdds8 expected = SampleSnapshot(snapshot, layer, centre);
      const LogOdds8 drawn = tile.pixels[static_cast<std::size_t>(row * kTileSide + column)];
      observed += expected != kUnobserved ? 1 : 0;
      different += drawn != expected ? 1 : 0;
    }
  }
  EXPECT_GT(observed, 0);
  return static_cast<double>(different) / observed;
}

TEST(TileRendererTest, TilesEqualAPlainReferenceUpToPixelsOnEdges) {
  WorldOptions options;
  options.overlay_count = 2;
  options.map_from_first = {-5.0, 3.0, 0.3};
  const Snapshot snapshot = MakeSnapshot(options);
  // Fixed point is off by 1/500 of a cell at most, so few centres fall into another one.
  EXPECT_LT(FractionThatDiffers(snapshot, Layer::kOccupancy, {8, 0, 0}), 0.004);
  EXPECT_LT(FractionThatDiffers(snapshot, Layer::kOccupancy, {8, -1, 0}), 0.004);
  EXPECT_LT(FractionThatDiffers(snapshot, Layer::kOccupancy, {10, 2, 1}), 0.004);
  EXPECT_LT(FractionThatDiffers(snapshot, Layer::kMoving, {8, 0, 0}), 0.02);
}

TEST(TileRendererTest, EveryVariantOfTheInnerLoopGivesTheSamePixels) {
  RandomSequence random(21);
  std::vector<LogOdds8> cells(97 * 61);
  cells.reserve((cells.size() + 3) / 4 * 4);
  for (LogOdds8& cell : cells) {
    cell = random.NextBits() % 4 == 0
               ? kUnobserved
               : static_cast<LogOdds8>(static_cast<int>(random.NextBits() % 201) - 100);
  }
  for (const SpanVariant variant : {SpanVariant::kAvx2, SpanVariant::kAvx512}) {
    const DrawSpanFunction draw = SpanFunctionOf(variant);
    if (draw == nullptr) {
      continue;  // this processor has no such instructions
    }
    for (int round = 0; round < 3000; ++round) {
      Span span;
      span.texture = {cells.data(), 97, 61, true};
      // Beyond the texture's borders too, where coordinates are held.
      span.u = static_cast<std::int32_t>(random.NextUniform(-3.0, 100.0) * 65536.0);
      span.v = static_cast<std::int32_t>(random.NextUniform(-3.0, 64.0) * 65536.0);
      span.du = static_cast<std::int32_t>(random.NextUniform(-1.0, 1.0) * 65536.0);
      span.dv = static_cast<std::int32_t>(random.NextUniform(-1.0, 1.0) * 65536.0);
      const auto count = static_cast<std::int32_t>(random.NextBits() % 80);
      std::vector<LogOdds8> expected(96);
      for (LogOdds8& pixel : expected) {
        pixel = random.NextBits() % 2 == 0
                    ? kUnobserved
                    : static_cast<LogOdds8>(static_cast<int>(random.NextBits() % 201) - 100);
      }
      std::vector<LogOdds8> pixels = expected;
      SpanFunctionOf(SpanVariant::kScalar)(span, expected.data() + 5, count);
      draw(span, pixels.data() + 5, count);
      ASSERT_EQ(pixels, expected);
    }
  }
}

TEST(TileRendererTest, TrianglesThatShareEdgesCoverEachPixelOnce) {
  RandomSequence random(22);
  for (int round = 0; round < 30; ++round) {
    // A fan around a point inside the canvas, beyond its borders outside; some corners on centres.
    std::vector<Eigen::Vector2d> ring;
    const int count = 3 + static_cast<int>(random.NextBits() % 9);
    for (int i = 0; i < count; ++i) {
      const double angle = 2.0 * kPi * (i + random.NextUniform(0.0, 0.4)) / count;
      ring.emplace_back(5.0 + 90.0 * std::cos(angle), 5.0 + 90.0 * std::sin(angle));
    }
    const Eigen::Vector2d centre = round % 2 == 0
                                       ? Eigen::Vector2d(5.05, 4.95)
                                       : Eigen::Vector2d(random.NextUniform(1.0, 9.0), 5.0);
    const std::vector<LogOdds8> cells(4, LogOdds8{1});
    std::vector<LogOdds8> pixels(100 * 100, LogOdds8{0});
    const Canvas canvas{Eigen::Vector2d::Zero(), 0.1, 100, 100, pixels.data(), 100};
    for (int i = 0; i < count; ++i) {
      TexturedPolygon triangle;
      triangle.corners_in_map = {centre,
                                 ring[static_cast<std::size_t>(i)],
                                 ring[static_cast<std::size_t>((i + 1) % count)]};
      triangle.map_from_texture = {triangle.corners_in_map[0],
                                   triangle.corners_in_map[1] - centre,
                                   triangle.corners_in_map[2] - centre};
      triangle.texture = {cells.data(), 2, 2, true};
      Draw(triangle, canvas, FastestSpanFunction());
    }
    EXPECT_EQ(std::count(pixels.begin(), pixels.end(), LogOdds8{1}), 100 * 100);
  }
}

TEST(TileRendererTest, TilesOfOneZoomAndRegionsFitTogether) {
  WorldOptions options;
  options.overlay_count = 1;
  const Snapshot snapshot = MakeSnapshot(options);
  for (const int zoom : {8, 7, 4}) {
    const double pixel_m = PixelSideM(zoom);
    const double side_m = TileSideM(zoom);
    const RasterImage region = RenderRegion(
        snapshot, Layer::kOccupancy, {Eigen::Vector2d(-side_m, -side_m), pixel_m, 512, 512});
    for (const int y : {-1, 0}) {
      for (const int x : {-1, 0}) {
        const TileImage tile = RenderTile(snapshot, Layer::kOccupancy, {zoom, x, y});
        int different = 0;
        for (int row = 0; row < kTileSide; ++row) {
          for (int column = 0; column < kTileSide; ++column) {
            const std::size_t at = static_cast<std::size_t>((256 * (y + 1) + 255 - row) * 512 +
                                                            256 * (x + 1) + column);
            different +=
                tile.pixels[static_cast<std::size_t>(row * kTileSide + column)] != region.pixels[at]
                    ? 1
                    : 0;
          }
        }
        EXPECT_LE(different, 20) << zoom << ' ' << x << ' ' << y;  // rounding of other origins
      }
    }
  }
}

TEST(TileRendererTest, WallsDoNotVanishInSmallPictures) {
  WorldOptions options;
  options.place_count = 12;
  options.map_from_first = {2.0, 3.0, 0.0};
  const Snapshot snapshot = MakeSnapshot(options);
  const Eigen::Vector2d wall(10.1, 1.0);  // in the middle of a wall of four cells
  ASSERT_GT(SampleSnapshot(snapshot, Layer::kOccupancy, wall), 0);
  for (int zoom = 8; zoom >= 0; --zoom) {
    const TileImage tile = RenderTile(snapshot, Layer::kOccupancy, {zoom, 0, 0});
    const double pixel_m = PixelSideM(zoom);
    const auto column = static_cast<int>(wall.x() / pixel_m);
    const int row = kTileSide - 1 - static_cast<int>(wall.y() / pixel_m);
    EXPECT_GT(tile.pixels[static_cast<std::size_t>(row * kTileSide + column)], 0) << zoom;
  }
  // Free space stays free where a pixel is smaller than a room.
  const TileImage tile = RenderTile(snapshot, Layer::kOccupancy, {5, 0, 0});
  const int row = kTileSide - 1 - static_cast<int>(2.5 / 0.4);
  const auto column = static_cast<int>(12.5 / 0.4);
  EXPECT_LT(tile.pixels[static_cast<std::size_t>(row * kTileSide + column)], 0);
}

TEST(TileRendererTest, FreshPlacesAndConsolidatedOnesLookAlike) {
  WorldOptions options;
  const Snapshot consolidated = MakeSnapshot(options);
  options.overlay_count = options.place_count;
  const Snapshot fresh = MakeSnapshot(options);
  ASSERT_TRUE(fresh.mesh->ltrs.empty());
  const TileImage left = RenderTile(consolidated, Layer::kOccupancy, {8, 0, 0});
  const TileImage right = RenderTile(fresh, Layer::kOccupancy, {8, 0, 0});
  int same = 0;
  for (std::size_t i = 0; i < left.pixels.size(); ++i) {
    same += (left.pixels[i] > 0) == (right.pixels[i] > 0) ? 1 : 0;
  }
  EXPECT_GT(same, kTileSide * kTileSide * 95 / 100);
}

TEST(TileRendererTest, BoundsHoldExactlyWhatWasObserved) {
  WorldOptions options;
  options.place_count = 1;
  options.map_from_first = {40.0, -7.0, 1.0};
  for (const int overlays : {0, 1}) {
    options.overlay_count = overlays;
    const BoxInMap bounds = MapBounds(MakeSnapshot(options), Layer::kOccupancy);
    EXPECT_NEAR(bounds.min.x(), 34.0, 0.15);
    EXPECT_NEAR(bounds.max.x(), 46.0, 0.15);
    EXPECT_NEAR(bounds.min.y(), -13.0, 0.15);
    EXPECT_NEAR(bounds.max.y(), -1.0, 0.15);
  }
  options.place_count = 0;
  options.overlay_count = 0;
  EXPECT_TRUE(MapBounds(MakeSnapshot(options), Layer::kOccupancy).Empty());
}

TEST(TileRendererTest, AnEmptyMapShowsNothing) {
  WorldOptions options;
  options.place_count = 0;
  const Snapshot snapshot = MakeSnapshot(options);
  for (const int zoom : {0, 8, 24}) {
    const TileImage tile = RenderTile(snapshot, Layer::kOccupancy, {zoom, 5, -9});
    EXPECT_EQ(std::count(tile.pixels.begin(), tile.pixels.end(), kUnobserved),
              kTileSide * kTileSide);
  }
}

TEST(TileRendererTest, TheDeepestZoomShowsSingleCells) {
  const Snapshot snapshot = MakeSnapshot({});
  const double side_m = TileSideM(24);
  const TileAddress address{
      24, static_cast<std::int32_t>(1.0 / side_m), static_cast<std::int32_t>(1.0 / side_m)};
  const TileImage tile = RenderTile(snapshot, Layer::kOccupancy, address);
  const std::set<LogOdds8> values(tile.pixels.begin(), tile.pixels.end());
  EXPECT_LE(values.size(), 2U);
  EXPECT_EQ(values.count(kUnobserved), 0U);
}

TEST(DirtyTilesTest, NamesEveryTileThatLooksDifferentAndNoneFarFromIt) {
  WorldOptions options;
  options.place_count = 12;
  options.overlay_count = 2;
  const Snapshot before = MakeSnapshot(options);
  EXPECT_TRUE(DirtyTiles(before, before, Layer::kOccupancy).empty());
  Snapshot after = before;
  after.places[11].map_from_place.x += 0.3;
  for (const auto& [from, to] : {std::pair(before, after), std::pair(after, before)}) {
    const std::vector<TileAddress> dirty = DirtyTiles(from, to, Layer::kOccupancy);
    std::set<TileAddress> named(dirty.begin(), dirty.end());
    EXPECT_EQ(named.size(), dirty.size());
    int different = 0;
    BoxInMap all = MapBounds(before, Layer::kOccupancy);
    all.Extend(MapBounds(after, Layer::kOccupancy));
    for (const TileAddress& tile : TilesUnder(all, kDirtyTileZoom)) {
      const bool differs = RenderTile(from, Layer::kOccupancy, tile).pixels !=
                           RenderTile(to, Layer::kOccupancy, tile).pixels;
      different += differs ? 1 : 0;
      EXPECT_TRUE(!differs || named.count(tile) == 1) << tile.x << ' ' << tile.y;
    }
    EXPECT_GT(different, 1);
    EXPECT_EQ(named.count({kDirtyTileZoom, 0, 0}), 0U);  // the place is 40 m away
  }
}

}  // namespace
}  // namespace loci
