// SPDX-License-Identifier: Apache-2.0
// What map clients ask, and parts of what they are answered.
#pragma once

#include <string>

#include "core/base/status.h"
#include "core/engine/snapshot.h"
#include "core/layer/layer.h"
#include "core/tile/tile_renderer.h"
#include "core/tile/zoom.h"
#include "loci/v1/map_query.pb.h"

namespace loci {

// kInvalidArgument for a name that is no layer's.
StatusOr<Layer> LayerFrom(const std::string& name);

// kOutOfRange names the index and its bounds.
StatusOr<TileAddress> TileAddressFrom(const v1::GetTileRequest& message);
StatusOr<int> ZoomFrom(std::uint32_t zoom);

// kInvalidArgument names the side that is not finite or beyond +-10^7 m, or the axis that is empty.
StatusOr<BoxInMap> BoxFrom(const v1::Region& message);

// The pixels of `resolution_m` that cover the box. kInvalidArgument for a resolution that is
// neither 0 nor from 0.001 to 100; kOutOfRange for more cells than `cells_max` or longer rows than
// `width_max`.
struct RasterLimits {
  std::uint64_t cells_max = 0;
  std::uint64_t width_max = 0;
};
StatusOr<RasterRegion> RasterRegionFrom(const BoxInMap& box,
                                        double resolution_m,
                                        const RasterLimits& limits);

void Fill(const Snapshot& snapshot, v1::Mesh& message);
void Fill(const Snapshot& snapshot, v1::Graph& message);
void Fill(const Snapshot& snapshot,
          const SessionSnapshot& session,
          const TrajectoryPose& pose,
          v1::StampedPose& message);

}  // namespace loci
