// SPDX-License-Identifier: Apache-2.0
// Draws textured triangles and quadrangles into a block of pixels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "core/geometry/affine.h"
#include "core/tile/span.h"
#include "core/tile/zoom.h"

namespace loci {

// A convex polygon of the map under a texture.
struct TexturedPolygon {
  std::array<Eigen::Vector2d, 4> corners_in_map = {Eigen::Vector2d::Zero(),
                                                   Eigen::Vector2d::Zero(),
                                                   Eigen::Vector2d::Zero(),
                                                   Eigen::Vector2d::Zero()};  // counter-clockwise
  std::size_t corner_count = 3;                                               // 3 or 4
  Affine2 map_from_texture;  // (column, row) of a cell's lower corner -> point in map
  TextureView texture;
};

// A block of pixels, row 0 lowest. Pixel (column, row) stands for its centre.
struct Canvas {
  static constexpr std::int32_t kSideMax = 256;

  Eigen::Vector2d origin_in_map;  // lower left corner
  double resolution_m = 0.0;      // side of a pixel
  std::int32_t width = 0;         // at most kSideMax
  std::int32_t height = 0;        // at most kSideMax
  LogOdds8* pixels = nullptr;
  std::ptrdiff_t stride = 0;  // pixels from one row to the next

  BoxInMap Box() const;
};

// Adds the polygon to the pixels whose centres it covers. Polygons that share an edge with the same
// corners cover each centre once, whatever the rounding: nothing is added twice, nothing is left
// out.
void Draw(const TexturedPolygon& polygon, const Canvas& canvas, DrawSpanFunction draw_span);

}  // namespace loci
