// SPDX-License-Identifier: Apache-2.0
// PNG files of tiles and regions.
//
// No filter and a fast deflate: on occupancy, filters make the file larger and the work longer.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/grid/log_odds_grid.h"
#include "core/layer/layer.h"
#include "core/tile/tile_renderer.h"

namespace loci {

enum class PngStyle : std::uint8_t {
  // 8 bits per pixel. Occupancy is grey: 254 free to 0 occupied by probability, 205 unobserved, as
  // map_server has it. Moving has a palette from transparent to red.
  kFull = 0,
  // "tri": a palette of 2 bits per pixel: unobserved, free, undecided, occupied. A quarter of the
  // size.
  kTri = 1,
};

// "full" (also the empty name) or "tri"; nothing for other names.
std::optional<PngStyle> PngStyleFromName(std::string_view name);

// A picture whose rows are given from top to bottom. `width` and `height` are at least 1 and
// pixels.size() is their product, at most 2^30. The result is a function of the arguments only.
std::string EncodePng(std::span<const LogOdds8> pixels,
                      std::uint32_t width,
                      std::uint32_t height,
                      Layer layer,
                      PngStyle style);

std::string EncodePng(const TileImage& tile, Layer layer, PngStyle style);
// Turns the rows: a RasterImage begins with the lowest.
std::string EncodePng(const RasterImage& image, Layer layer, PngStyle style);

}  // namespace loci
