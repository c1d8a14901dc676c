// SPDX-License-Identifier: Apache-2.0
#include "server/service/map_query_service.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/name.h"
#include "core/tile/tile_renderer.h"
#include "loci/v1/map_query.pb.h"
#include "server/convert/map_query_convert.h"
#include "server/service/trajectory_merge.h"

namespace loci {
namespace {

// What a region request is about: all of the layer if it names no region.
StatusOr<BoxInMap> BoxOfRequest(bool has_region,
                                const v1::Region& region,
                                const Snapshot& snapshot,
                                Layer layer) {
  return has_region ? BoxFrom(region) : StatusOr<BoxInMap>(MapBounds(snapshot, layer));
}

// The tiles under the box, if they are not too many. They are counted before they are listed.
StatusOr<std::vector<TileAddress>> TilesOfBox(const BoxInMap& box,
                                              int zoom,
                                              std::uint64_t tiles_max) {
  if (box.Empty()) {
    return std::vector<TileAddress>();
  }
  const double side_m = TileSideM(zoom);
  const Eigen::Array2d count =
      (box.max.array() / side_m).floor() - (box.min.array() / side_m).floor() + 1.0;
  if (count.x() * count.y() > static_cast<double>(tiles_max)) {
    return OutOfRangeError("region: " + std::to_string(static_cast<std::uint64_t>(count.prod())) +
                           " tiles at zoom " + std::to_string(zoom) + ", must be at most " +
                           std::to_string(tiles_max));
  }
  return TilesUnder(box, zoom);
}

void Fill(Revision revision, const TileAddress& address, const std::string& png, v1::Tile& tile) {
  tile.set_revision(revision.value);
  tile.set_zoom(static_cast<std::uint32_t>(address.zoom));
  tile.set_x(address.x);
  tile.set_y(address.y);
  tile.set_png(png);
}

// Renders a raster in strips of whole rows, from the lowest up.
class RasterStrips {
 public:
  RasterStrips(std::shared_ptr<const Snapshot> snapshot,
               Layer layer,
               const RasterRegion& whole,
               std::size_t chunk_bytes)
      : snapshot_(std::move(snapshot)),
        layer_(layer),
        whole_(whole),
        rows_per_strip_(std::max<std::int32_t>(
            1, static_cast<std::int32_t>(chunk_bytes) / std::max(whole.width, 1))) {}

  StreamStep Next(v1::RasterRows& rows) {
    if (next_row_ >= whole_.height) {
      return StreamStep::kEnd;
    }
    RasterRegion strip = whole_;
    strip.origin_in_map.y() += next_row_ * whole_.resolution_m;
    strip.height = std::min(rows_per_strip_, whole_.height - next_row_);
    const RasterImage image = RenderRegion(*snapshot_, layer_, strip);
    rows.set_revision(snapshot_->revision.value);
    rows.set_x_min_m(whole_.origin_in_map.x());
    rows.set_y_min_m(whole_.origin_in_map.y());
    rows.set_resolution_m(whole_.resolution_m);
    rows.set_width(static_cast<std::uint32_t>(whole_.width));
    rows.set_height(static_cast<std::uint32_t>(whole_.height));
    rows.set_first_row(static_cast<std::uint32_t>(next_row_));
    rows.mutable_cells()->assign(image.pixels.begin(), image.pixels.end());
    next_row_ += strip.height;
    return StreamStep::kMessage;
  }

 private:
  const std::shared_ptr<const Snapshot> snapshot_;
  const Layer layer_;
  const RasterRegion whole_;
  const std::int32_t rows_per_strip_;
  std::int32_t next_row_ = 0;
};

}  // namespace

void MapQueryService::AddTo(Dispatcher& dispatcher) {
  dispatcher.AddService("loci.v1.MapQuery");
  AddTiles(dispatcher);
  AddRaster(dispatcher);
  AddTrajectory(dispatcher);
  AddShapes(dispatcher);
}

void MapQueryService::AddTiles(Dispatcher& dispatcher) {
  dispatcher.AddUnary<v1::GetTileRequest, v1::Tile>(
      "loci.v1.MapQuery/GetTile",
      Execution::kWorker,
      [this](ServerCall&, const v1::GetTileRequest& request) -> StatusOr<v1::Tile> {
        LOCI_ASSIGN_OR_RETURN(const Layer layer, LayerFrom(request.layer()));
        LOCI_ASSIGN_OR_RETURN(const TileAddress address, TileAddressFrom(request));
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<const Snapshot> snapshot,
                              maps_.FindSnapshot(request.map(), Revision{request.revision()}));
        v1::Tile tile;
        Fill(snapshot->revision, address, *tiles_.FindOrRender(snapshot, layer, address), tile);
        return tile;
      });
  dispatcher.AddServerStream<v1::StreamTilesRequest, v1::Tile>(
      "loci.v1.MapQuery/StreamTiles",
      Execution::kWorker,
      [this](const std::shared_ptr<ServerCall>&,
             const v1::StreamTilesRequest& request) -> StatusOr<StreamSource<v1::Tile>> {
        LOCI_ASSIGN_OR_RETURN(const Layer layer, LayerFrom(request.layer()));
        LOCI_ASSIGN_OR_RETURN(const int zoom, ZoomFrom(request.zoom()));
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<const Snapshot> snapshot,
                              maps_.FindSnapshot(request.map(), Revision{request.revision()}));
        LOCI_ASSIGN_OR_RETURN(
            const BoxInMap box,
            BoxOfRequest(request.has_region(), request.region(), *snapshot, layer));
        LOCI_ASSIGN_OR_RETURN(std::vector<TileAddress> addresses,
                              TilesOfBox(box, zoom, limits_.stream_tiles_max));
        return StreamSource<v1::Tile>([this, snapshot, layer, addresses, next = std::size_t{0}](
                                          v1::Tile& tile) mutable -> StatusOr<StreamStep> {
          if (next == addresses.size()) {
            return StreamStep::kEnd;
          }
          const TileAddress& address = addresses[next++];
          Fill(snapshot->revision, address, *tiles_.FindOrRender(snapshot, layer, address), tile);
          return StreamStep::kMessage;
        });
      });
}

void MapQueryService::AddRaster(Dispatcher& dispatcher) {
  dispatcher.AddServerStream<v1::StreamRasterRequest, v1::RasterRows>(
      "loci.v1.MapQuery/StreamRaster",
      Execution::kWorker,
      [this](const std::shared_ptr<ServerCall>&,
             const v1::StreamRasterRequest& request) -> StatusOr<StreamSource<v1::RasterRows>> {
        LOCI_ASSIGN_OR_RETURN(const Layer layer, LayerFrom(request.layer()));
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<const Snapshot> snapshot,
                              maps_.FindSnapshot(request.map(), Revision{request.revision()}));
        LOCI_ASSIGN_OR_RETURN(
            const BoxInMap box,
            BoxOfRequest(request.has_region(), request.region(), *snapshot, layer));
        const bool default_resolution = request.resolution_m() == 0.0;
        RasterRegion region;  // of no rows: the layer is empty
        if (!box.Empty()) {
          LOCI_ASSIGN_OR_RETURN(region,
                                RasterRegionFrom(box,
                                                 default_resolution ? snapshot->settings.cell_size_m
                                                                    : request.resolution_m(),
                                                 {.cells_max = limits_.stream_raster_cells_max,
                                                  .width_max = limits_.stream_chunk_bytes}));
        }
        const auto strips =
            std::make_shared<RasterStrips>(snapshot, layer, region, limits_.stream_chunk_bytes);
        return StreamSource<v1::RasterRows>(
            [strips](v1::RasterRows& rows) -> StatusOr<StreamStep> { return strips->Next(rows); });
      });
}

void MapQueryService::AddTrajectory(Dispatcher& dispatcher) {
  dispatcher.AddServerStream<v1::StreamTrajectoryRequest, v1::TrajectoryPoses>(
      "loci.v1.MapQuery/StreamTrajectory",
      Execution::kWorker,
      [this](const std::shared_ptr<ServerCall>&, const v1::StreamTrajectoryRequest& request)
          -> StatusOr<StreamSource<v1::TrajectoryPoses>> {
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<const Snapshot> snapshot,
                              maps_.FindSnapshot(request.map(), Revision{request.revision()}));
        if (!request.session().empty()) {
          LOCI_RETURN_IF_ERROR(ValidateName(request.session(), "session"));
        }
        LOCI_ASSIGN_OR_RETURN(TrajectoryMerge merge,
                              TrajectoryMerge::Create(snapshot, request.session()));
        return StreamSource<v1::TrajectoryPoses>(
            [snapshot, merge = std::move(merge), poses_max = limits_.stream_poses](
                v1::TrajectoryPoses& poses) mutable -> StatusOr<StreamStep> {
              poses.set_revision(snapshot->revision.value);
              while (!merge.Done() && static_cast<std::size_t>(poses.poses_size()) < poses_max) {
                loci::Fill(*snapshot, merge.session(), merge.pose(), *poses.add_poses());
                merge.Advance();
              }
              return poses.poses_size() > 0 ? StreamStep::kMessage : StreamStep::kEnd;
            });
      });
}

void MapQueryService::AddShapes(Dispatcher& dispatcher) {
  dispatcher.AddUnary<v1::GetMeshRequest, v1::Mesh>(
      "loci.v1.MapQuery/GetMesh",
      Execution::kWorker,
      [this](ServerCall&, const v1::GetMeshRequest& request) -> StatusOr<v1::Mesh> {
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<const Snapshot> snapshot,
                              maps_.FindSnapshot(request.map(), Revision{request.revision()}));
        v1::Mesh mesh;
        loci::Fill(*snapshot, mesh);
        return mesh;
      });
  dispatcher.AddUnary<v1::GetGraphRequest, v1::Graph>(
      "loci.v1.MapQuery/GetGraph",
      Execution::kWorker,
      [this](ServerCall&, const v1::GetGraphRequest& request) -> StatusOr<v1::Graph> {
        LOCI_ASSIGN_OR_RETURN(const std::shared_ptr<const Snapshot> snapshot,
                              maps_.FindSnapshot(request.map(), Revision{request.revision()}));
        v1::Graph graph;
        loci::Fill(*snapshot, graph);
        return graph;
      });
}

}  // namespace loci
