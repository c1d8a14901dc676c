// SPDX-License-Identifier: Apache-2.0
// What several commands ask of a map, put together from its streams.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/cli/context.h"
#include "core/base/status.h"
#include "loci/v1/map_query.pb.h"

namespace loci::cli {

// A picture of a layer. Row 0 is the lowest.
struct Raster {
  static constexpr std::int8_t kUnobserved = -128;

  std::uint64_t revision = 0;
  double x_min_m = 0.0;
  double y_min_m = 0.0;
  double resolution_m = 0.0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<std::int8_t> cells;  // log-odds in steps of 0.04

  std::int8_t at(std::int32_t column, std::int32_t row) const {
    return cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(column)];
  }
};

struct RasterRequest {
  std::string map = {};
  std::string layer = "occupancy";
  double resolution_m = 0.0;   // 0: the layer's
  std::uint64_t revision = 0;  // 0: the newest
};

// All of a layer. kFailedPrecondition if nothing of it is observed yet; kInternal if the server's
// rows do not make one picture.
StatusOr<Raster> FetchRaster(Context& context, const RasterRequest& request);

struct Trajectory {
  std::uint64_t revision = 0;
  std::vector<v1::StampedPose> poses;  // in order of stamp
};

// `session` empty: all sessions. `revision` 0: the newest.
StatusOr<Trajectory> FetchTrajectory(Context& context,
                                     const std::string& map,
                                     const std::string& session,
                                     std::uint64_t revision);

}  // namespace loci::cli
