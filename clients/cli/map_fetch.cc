// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/map_fetch.h"

#include <algorithm>
#include <utility>

namespace loci::cli {
namespace {

// 32768 x 32768: 1.6 km x 1.6 km at 5 cm. More is a damaged answer or too much for one picture.
constexpr std::uint64_t kCellsMax = std::uint64_t{1} << 30U;

Status TakeHeader(const v1::RasterRows& rows, const RasterRequest& request, Raster& raster) {
  if (std::uint64_t{rows.width()} * rows.height() > kCellsMax) {
    return OutOfRangeError("map " + request.map + " has " + std::to_string(rows.width()) + " x " +
                           std::to_string(rows.height()) + " cells, must be at most " +
                           std::to_string(kCellsMax) +
                           " for one picture; ask for a coarser resolution");
  }
  raster.revision = rows.revision();
  raster.x_min_m = rows.x_min_m();
  raster.y_min_m = rows.y_min_m();
  raster.resolution_m = rows.resolution_m();
  raster.width = static_cast<std::int32_t>(rows.width());
  raster.height = static_cast<std::int32_t>(rows.height());
  raster.cells.assign(std::size_t{rows.width()} * rows.height(), Raster::kUnobserved);
  return {};
}

// The first message of the stream says how large the picture is.
Status TakeRows(const v1::RasterRows& rows, const RasterRequest& request, Raster& raster) {
  if (raster.cells.empty()) {
    LOCI_RETURN_IF_ERROR(TakeHeader(rows, request, raster));
  }
  const std::size_t begin = std::size_t{rows.first_row()} * static_cast<std::size_t>(raster.width);
  if (rows.cells().size() > raster.cells.size() ||
      begin > raster.cells.size() - rows.cells().size()) {
    return InternalError("the server's rows from row " + std::to_string(rows.first_row()) +
                         " do not fit into its picture");
  }
  std::transform(rows.cells().begin(),
                 rows.cells().end(),
                 raster.cells.begin() + static_cast<std::ptrdiff_t>(begin),
                 [](char cell) { return static_cast<std::int8_t>(cell); });
  return {};
}

}  // namespace

StatusOr<Raster> FetchRaster(Context& context, const RasterRequest& request) {
  LOCI_RETURN_IF_ERROR(context.AwaitMap(request.map));
  v1::StreamRasterRequest message;
  message.set_map(request.map);
  message.set_layer(request.layer);
  message.set_resolution_m(request.resolution_m);
  message.set_revision(request.revision);
  auto stream = context.Stream<v1::RasterRows>("loci.v1.MapQuery/StreamRaster", message);
  Raster raster;
  v1::RasterRows rows;
  while (stream.Next(rows)) {
    LOCI_RETURN_IF_ERROR(TakeRows(rows, request, raster));
  }
  LOCI_RETURN_IF_ERROR(stream.status());
  if (raster.cells.empty()) {
    return FailedPreconditionError("layer " + request.layer + " of map " + request.map +
                                   " holds nothing yet; stream observations first");
  }
  return raster;
}

StatusOr<Trajectory> FetchTrajectory(Context& context,
                                     const std::string& map,
                                     const std::string& session,
                                     std::uint64_t revision) {
  LOCI_RETURN_IF_ERROR(context.AwaitMap(map));
  v1::StreamTrajectoryRequest message;
  message.set_map(map);
  message.set_session(session);
  message.set_revision(revision);
  auto stream = context.Stream<v1::TrajectoryPoses>("loci.v1.MapQuery/StreamTrajectory", message);
  Trajectory trajectory;
  v1::TrajectoryPoses poses;
  while (stream.Next(poses)) {
    trajectory.revision = poses.revision();
    trajectory.poses.insert(trajectory.poses.end(), poses.poses().begin(), poses.poses().end());
  }
  LOCI_RETURN_IF_ERROR(stream.status());
  std::stable_sort(trajectory.poses.begin(),
                   trajectory.poses.end(),
                   [](const auto& a, const auto& b) { return a.stamp_ns() < b.stamp_ns(); });
  return trajectory;
}

}  // namespace loci::cli
