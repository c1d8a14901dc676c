// SPDX-License-Identifier: Apache-2.0
// Claims: a tile is drawn at least 3 times as fast as by OpenCV (warpAffine with nearest cell, and
// a mask of the triangle) from the same triangles, and a PNG is made several times as fast as by
// libpng with its defaults.
//
//   tile_bench [--log LOG] [--rounds N] [--seconds S]
//
// Without a log the map is a made-up building. Rates are per second of one thread's processor time.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <png.h>

#include "bench/contestants.h"
#include "bench/map_of_log.h"
#include "core/tile/tile_renderer.h"
#include "server/tile/png_encoder.h"
#include "tests/support/snapshots.h"

#if LOCI_BENCH_HAS_OPENCV
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#endif

namespace loci {
namespace {

struct Arguments {
  std::string log;
  int rounds = 7;
  double seconds = 0.2;  // per contestant and round
};

constexpr int kZoom = 8;

// So that nothing is optimised away.
std::uint64_t g_sum = 0;

std::vector<TileAddress> TilesWithContent(const Snapshot& snapshot) {
  std::vector<TileAddress> tiles;
  for (const TileAddress& address : TilesUnder(MapBounds(snapshot, Layer::kOccupancy), kZoom)) {
    const TileImage tile = RenderTile(snapshot, Layer::kOccupancy, address);
    if (std::count(tile.pixels.begin(), tile.pixels.end(), kUnobserved) < kTileSide * kTileSide) {
      tiles.push_back(address);
    }
  }
  return tiles;
}

#if LOCI_BENCH_HAS_OPENCV

// The same picture by OpenCV's functions: each triangle's texture is warped into the box around it
// and copied under a mask. Unobserved cells overwrite, which spares OpenCV the adding.
class OpenCvRenderer {
 public:
  explicit OpenCvRenderer(const MeshSnapshot& mesh) {
    cv::setNumThreads(1);
    for (const LtrSnapshot& ltr : mesh.ltrs) {
      Warped warped;
      const LtrTexture& texture = *ltr.occupancy;
      // warpAffine knows unsigned bytes; as bits they are the same.
      warped.texture = cv::Mat(texture.row_count,
                               texture.column_count,
                               CV_8U,
                               const_cast<LogOdds8*>(texture.cells.data()));
      for (std::size_t i = 0; i < 3; ++i) {
        warped.corners[i] = mesh.vertices_in_map[ltr.vertices[i].value];
        warped.box.Extend(warped.corners[i]);
      }
      triangles_.push_back(warped);
    }
  }

  cv::Mat Render(const TileAddress& address) const {
    const BoxInMap box = BoxOf(address);
    const double pixel_m = PixelSideM(address.zoom);
    cv::Mat tile(kTileSide, kTileSide, CV_8U, cv::Scalar(128));
    for (const Warped& triangle : triangles_) {
      if (!triangle.box.Intersects(box)) {
        continue;
      }
      // In pixels of the tile, y down.
      cv::Point2f corners[3];
      for (std::size_t i = 0; i < 3; ++i) {
        corners[i] = {static_cast<float>((triangle.corners[i].x() - box.min.x()) / pixel_m),
                      static_cast<float>((box.max.y() - triangle.corners[i].y()) / pixel_m)};
      }
      DrawTriangle(triangle.texture, corners, tile);
    }
    return tile;
  }

 private:
  struct Warped {
    cv::Mat texture;
    std::array<Eigen::Vector2d, 3> corners;
    BoxInMap box;
  };

  static void DrawTriangle(const cv::Mat& texture, const cv::Point2f (&corners)[3], cv::Mat& tile) {
    const std::vector<cv::Point2f> points(corners, corners + 3);
    const cv::Rect roi = cv::boundingRect(points) & cv::Rect(0, 0, kTileSide, kTileSide);
    if (roi.empty()) {
      return;
    }
    cv::Point2f in_roi[3];
    cv::Point fixed[3];
    constexpr int kShift = 6;
    for (int i = 0; i < 3; ++i) {
      // Pixels and cells stand for their centres there.
      in_roi[i] = corners[i] -
                  cv::Point2f(static_cast<float>(roi.x) + 0.5F, static_cast<float>(roi.y) + 0.5F);
      fixed[i] = {cvRound(in_roi[i].x * (1 << kShift)), cvRound(in_roi[i].y * (1 << kShift))};
    }
    const auto columns = static_cast<float>(texture.cols);
    const auto rows = static_cast<float>(texture.rows);
    const cv::Point2f in_texture[3] = {
        {-0.5F, -0.5F}, {columns - 0.5F, -0.5F}, {-0.5F, rows - 0.5F}};
    cv::Mat warped;
    cv::warpAffine(texture,
                   warped,
                   cv::getAffineTransform(in_texture, in_roi),
                   roi.size(),
                   cv::INTER_NEAREST,
                   cv::BORDER_REPLICATE);
    cv::Mat mask(roi.size(), CV_8U, cv::Scalar(0));
    cv::fillConvexPoly(mask, fixed, 3, cv::Scalar(255), cv::LINE_8, kShift);
    warped.copyTo(tile(roi), mask);
  }

  std::vector<Warped> triangles_;
};

void CompareDrawing(const Snapshot& snapshot,
                    const std::vector<TileAddress>& tiles,
                    const Arguments& arguments) {
  const OpenCvRenderer opencv(*snapshot.mesh);
  std::size_t same = 0;
  for (const TileAddress& address : tiles) {
    const TileImage ours = RenderTile(snapshot, Layer::kOccupancy, address);
    const cv::Mat theirs = opencv.Render(address);
    for (std::size_t i = 0; i < ours.pixels.size(); ++i) {
      same += static_cast<std::uint8_t>(ours.pixels[i]) == theirs.data[i] ? 1U : 0U;
    }
  }
  std::printf("pixels that are the same as OpenCV's: %.2f %%\n",
              100.0 * static_cast<double>(same) /
                  static_cast<double>(tiles.size() * kTileSide * kTileSide));
  std::vector<Contestant> contestants = {
      {"draw a tile (RenderTile)",
       [&] {
         for (const TileAddress& address : tiles) {
           g_sum += static_cast<std::uint8_t>(
               RenderTile(snapshot, Layer::kOccupancy, address).pixels[99]);
         }
       },
       static_cast<double>(tiles.size()),
       {}},
      {"OpenCV warpAffine nearest + fillConvexPoly",
       [&] {
         for (const TileAddress& address : tiles) {
           g_sum += opencv.Render(address).data[99];
         }
       },
       static_cast<double>(tiles.size()),
       {}},
  };
  RunInterleaved(contestants, arguments.rounds, arguments.seconds);
  PrintRatios(contestants, "tiles");
}

#else

void CompareDrawing(const Snapshot& snapshot,
                    const std::vector<TileAddress>& tiles,
                    const Arguments& arguments) {
  std::printf("OpenCV SKIPPED: built without libopencv-imgproc-dev, no peer for drawing\n");
  std::vector<Contestant> contestants = {
      {"draw a tile (RenderTile)",
       [&] {
         for (const TileAddress& address : tiles) {
           g_sum += static_cast<std::uint8_t>(
               RenderTile(snapshot, Layer::kOccupancy, address).pixels[99]);
         }
       },
       static_cast<double>(tiles.size()),
       {}}};
  RunInterleaved(contestants, arguments.rounds, arguments.seconds);
  PrintRatios(contestants, "tiles");
}

#endif

// libpng as most programs use it: level 6, filters chosen by itself.
std::size_t EncodeByLibpng(const std::vector<std::uint8_t>& greys) {
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png,
      &bytes,
      [](png_structp writer, png_bytep data, png_size_t size) {
        static_cast<std::string*>(png_get_io_ptr(writer))
            ->append(reinterpret_cast<const char*>(data), size);
      },
      nullptr);
  png_set_IHDR(png,
               info,
               kTileSide,
               kTileSide,
               8,
               PNG_COLOR_TYPE_GRAY,
               PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  for (std::size_t row = 0; row < kTileSide; ++row) {
    png_write_row(png, greys.data() + row * kTileSide);
  }
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return bytes.size();
}

void CompareEncoding(const Snapshot& snapshot,
                     const std::vector<TileAddress>& addresses,
                     const Arguments& arguments) {
  std::vector<TileImage> tiles;
  std::vector<std::vector<std::uint8_t>> greys;
  std::size_t full_bytes = 0;
  std::size_t tri_bytes = 0;
  std::size_t libpng_bytes = 0;
  for (const TileAddress& address : addresses) {
    tiles.push_back(RenderTile(snapshot, Layer::kOccupancy, address));
    std::vector<std::uint8_t> grey;
    for (const LogOdds8 pixel : tiles.back().pixels) {
      grey.push_back(static_cast<std::uint8_t>(127 - pixel));
    }
    greys.push_back(std::move(grey));
    full_bytes += EncodePng(tiles.back(), Layer::kOccupancy, PngStyle::kFull).size();
    tri_bytes += EncodePng(tiles.back(), Layer::kOccupancy, PngStyle::kTri).size();
    libpng_bytes += EncodeByLibpng(greys.back());
  }
  std::printf("bytes of a PNG: %zu, tri %zu, libpng %zu\n",
              full_bytes / tiles.size(),
              tri_bytes / tiles.size(),
              libpng_bytes / tiles.size());
  const auto encode_all = [&](PngStyle style) {
    for (const TileImage& tile : tiles) {
      g_sum += EncodePng(tile, Layer::kOccupancy, style).size();
    }
  };
  const auto count = static_cast<double>(tiles.size());
  std::vector<Contestant> contestants = {
      {"PNG, grey (EncodePng)", [&] { encode_all(PngStyle::kFull); }, count, {}},
      {"PNG, tri", [&] { encode_all(PngStyle::kTri); }, count, {}},
      {"libpng, level 6, default filters",
       [&] {
         for (const std::vector<std::uint8_t>& grey : greys) {
           g_sum += EncodeByLibpng(grey);
         }
       },
       count,
       {}},
  };
  RunInterleaved(contestants, arguments.rounds, arguments.seconds);
  PrintRatios(contestants, "PNG");
}

Status Run(const Arguments& arguments) {
  std::shared_ptr<const Snapshot> snapshot;
  if (arguments.log.empty()) {
    testing::WorldOptions options;
    options.place_count = 12;
    options.radius_m = 12.0;
    snapshot = std::make_shared<const Snapshot>(testing::MakeSnapshot(options));
  } else {
    LOCI_ASSIGN_OR_RETURN(const MappedLog mapped, MapOfLog(arguments.log));
    snapshot = mapped.snapshot;
  }
  const std::vector<TileAddress> tiles = TilesWithContent(*snapshot);
  if (tiles.empty()) {
    return InvalidArgumentError(arguments.log + ": the map of this log is empty");
  }
  std::printf("map: %s, %zu LTRs, %zu fresh places, %zu tiles at zoom %d\n",
              arguments.log.empty() ? "made-up building" : arguments.log.c_str(),
              snapshot->mesh->ltrs.size(),
              snapshot->overlays.size(),
              tiles.size(),
              kZoom);
  CompareDrawing(*snapshot, tiles, arguments);
  CompareEncoding(*snapshot, tiles, arguments);
  return {};
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  loci::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (i + 1 < argc && word == "--log") {
      arguments.log = argv[++i];
    } else if (i + 1 < argc && word == "--rounds") {
      arguments.rounds = std::max(1, std::atoi(argv[++i]));
    } else if (i + 1 < argc && word == "--seconds") {
      arguments.seconds = std::atof(argv[++i]);
    } else {
      std::fprintf(stderr, "usage: tile_bench [--log LOG] [--rounds N] [--seconds S]\n");
      return 2;
    }
  }
  if (const loci::Status status = loci::Run(arguments); !status.ok()) {
    std::fprintf(stderr, "%s\n", status.ToString().c_str());
    return 1;
  }
  return 0;
}
