// SPDX-License-Identifier: Apache-2.0
#include "server/convert/map_query_convert.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "core/base/name.h"
#include "server/convert/pose_convert.h"

namespace loci {
namespace {

// Beyond every tile at zoom 8 that is worth drawing, and far inside of what int32 cells can hold.
constexpr double kRegionMaxM = 1e7;
// Rows that an int32 can count.
constexpr double kHeightMax = 1e9;
constexpr double kResolutionMinM = 0.001;
constexpr double kResolutionMaxM = 100.0;

std::string Text(double value) {
  std::array<char, 32> buffer = {};
  std::snprintf(buffer.data(), buffer.size(), "%.9g", value);
  return buffer.data();
}

Status CheckSide(double value, const char* field) {
  if (value >= -kRegionMaxM && value <= kRegionMaxM) {  // false for NaN
    return {};
  }
  return InvalidArgumentError(std::string("region.") + field + ": " + Text(value) +
                              ", must be from " + Text(-kRegionMaxM) + " to " + Text(kRegionMaxM));
}

Status CheckAxis(double low, double high, const char* axis) {
  if (low < high) {
    return {};
  }
  return InvalidArgumentError(std::string("region.") + axis + "_max_m: " + Text(high) +
                              ", must be above region." + axis + "_min_m, " + Text(low));
}

}  // namespace

StatusOr<Layer> LayerFrom(const std::string& name) {
  LOCI_RETURN_IF_ERROR(ValidateName(name, "layer"));
  const std::optional<Layer> layer = LayerFromName(name);
  if (!layer.has_value()) {
    return InvalidArgumentError("layer: \"" + name + "\", must be \"occupancy\" or \"moving\"");
  }
  return *layer;
}

StatusOr<int> ZoomFrom(std::uint32_t zoom) {
  if (zoom > static_cast<std::uint32_t>(kZoomMax)) {
    return OutOfRangeError("zoom: " + std::to_string(zoom) + ", must be from 0 to " +
                           std::to_string(kZoomMax));
  }
  return static_cast<int>(zoom);
}

StatusOr<TileAddress> TileAddressFrom(const v1::GetTileRequest& message) {
  TileAddress address{0, message.x(), message.y()};
  LOCI_ASSIGN_OR_RETURN(address.zoom, ZoomFrom(message.zoom()));
  LOCI_RETURN_IF_ERROR(Validate(address));
  return address;
}

StatusOr<BoxInMap> BoxFrom(const v1::Region& message) {
  LOCI_RETURN_IF_ERROR(CheckSide(message.x_min_m(), "x_min_m"));
  LOCI_RETURN_IF_ERROR(CheckSide(message.y_min_m(), "y_min_m"));
  LOCI_RETURN_IF_ERROR(CheckSide(message.x_max_m(), "x_max_m"));
  LOCI_RETURN_IF_ERROR(CheckSide(message.y_max_m(), "y_max_m"));
  LOCI_RETURN_IF_ERROR(CheckAxis(message.x_min_m(), message.x_max_m(), "x"));
  LOCI_RETURN_IF_ERROR(CheckAxis(message.y_min_m(), message.y_max_m(), "y"));
  return BoxInMap{{message.x_min_m(), message.y_min_m()}, {message.x_max_m(), message.y_max_m()}};
}

StatusOr<RasterRegion> RasterRegionFrom(const BoxInMap& box,
                                        double resolution_m,
                                        const RasterLimits& limits) {
  if (!(resolution_m >= kResolutionMinM && resolution_m <= kResolutionMaxM)) {
    return InvalidArgumentError("resolution_m: " + Text(resolution_m) + ", must be 0 or from " +
                                Text(kResolutionMinM) + " to " + Text(kResolutionMaxM));
  }
  // The lower left corner lies on the lattice of cells, so that rasters of neighbouring regions
  // fit.
  const Eigen::Array2d first = (box.min.array() / resolution_m).floor();
  const Eigen::Array2d count = ((box.max.array() / resolution_m).ceil() - first).max(1.0);
  const double cells = count.x() * count.y();
  if (count.x() > static_cast<double>(limits.width_max) || count.y() > kHeightMax ||
      cells > static_cast<double>(limits.cells_max)) {
    return OutOfRangeError("region: " + Text(count.x()) + " x " + Text(count.y()) +
                           " cells, must be at most " + std::to_string(limits.width_max) +
                           " wide and " + std::to_string(limits.cells_max) + " in all");
  }
  return RasterRegion{.origin_in_map = (first * resolution_m).matrix(),
                      .resolution_m = resolution_m,
                      .width = static_cast<std::int32_t>(count.x()),
                      .height = static_cast<std::int32_t>(count.y())};
}

void Fill(const Snapshot& snapshot, v1::Mesh& message) {
  message.set_revision(snapshot.revision.value);
  for (const Eigen::Vector2d& vertex : snapshot.mesh->vertices_in_map) {
    message.add_vertices_m(vertex.x());
    message.add_vertices_m(vertex.y());
  }
  for (const LtrSnapshot& ltr : snapshot.mesh->ltrs) {
    for (const VertexId vertex : ltr.vertices) {
      message.add_ltr_vertices(vertex.value);
    }
  }
}

void Fill(const Snapshot& snapshot, v1::Graph& message) {
  message.set_revision(snapshot.revision.value);
  for (const PlaceSnapshot& place : snapshot.places) {
    v1::Graph::Node& node = *message.add_nodes();
    node.set_place(place.id.value);
    Fill(place.map_from_place, *node.mutable_map_from_place());
    node.set_session(snapshot.sessions[place.session.value].session);
  }
  for (const ConstraintSnapshot& constraint : *snapshot.constraints) {
    v1::Graph::Edge& edge = *message.add_edges();
    edge.set_from_place(constraint.from.value);
    edge.set_to_place(constraint.to.value);
    edge.set_closure(constraint.closure);
    Fill(constraint.from_from_to, *edge.mutable_from_from_to());
    FillUpper(constraint.information, *edge.mutable_information());
  }
}

void Fill(const Snapshot& snapshot,
          const SessionSnapshot& session,
          const TrajectoryPose& pose,
          v1::StampedPose& message) {
  message.set_stamp_ns(pose.stamp_ns);
  Fill(snapshot.places[pose.place.value].map_from_place * pose.place_from_robot,
       *message.mutable_map_from_robot());
  message.set_place(pose.place.value);
  message.set_session(session.session);
}

}  // namespace loci
