// SPDX-License-Identifier: Apache-2.0
// Everything of a snapshot that one layer shows, as textured polygons.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <vector>

#include "core/engine/snapshot.h"
#include "core/layer/layer.h"
#include "core/tile/rasterizer.h"
#include "core/tile/zoom.h"

namespace loci {

struct Drawable {
  TexturedPolygon polygon;
  BoxInMap box;
  // The fine cells that it comes from. While both live, equal sources have equal content.
  const void* source = nullptr;
  // Columns of a row that belong to the polygon: all of a quadrangle, a triangle's share of a
  // triangle.
  std::int32_t ColumnCount(std::int32_t row) const;
};

// What of a snapshot to look at, and how.
struct SceneOptions {
  Layer layer = Layer::kOccupancy;
  BoxInMap box;             // what does not meet it is left out
  bool everything = false;  // do not look at the box
  bool coarse = false;      // textures of squares of LtrTexture::kCoarseSide cells
};

// The LTRs of the layer, then blocks of cells of fresh places, in the snapshot's order. Lives no
// longer than the snapshot.
class Scene {
 public:
  Scene(const Snapshot& snapshot, const SceneOptions& options);
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  const std::vector<const Drawable*>& drawables() const { return pointers_; }

 private:
  using CoarseBlock = std::array<LogOdds8, 64>;

  void AddMesh(const MeshSnapshot& mesh, const SceneOptions& options);
  void AddOverlay(const LogOddsGrid& grid,
                  const Pose2& map_from_place,
                  double cell_size_m,
                  const SceneOptions& options);
  void Add(Drawable drawable, const SceneOptions& options);

  std::deque<Drawable> drawables_;
  std::deque<CoarseBlock> coarse_blocks_;
  std::vector<const Drawable*> pointers_;
};

}  // namespace loci
