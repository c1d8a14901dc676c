// SPDX-License-Identifier: Apache-2.0
#include "core/tile/tile_renderer.h"

#include <algorithm>

#include "core/base/check.h"
#include "core/tile/scene.h"

namespace loci {
namespace {

// Each pixel of the block at `to` becomes the largest of four finer ones.
void TakeMaxima(const Canvas& finer, LogOdds8* to, std::ptrdiff_t stride) {
  for (std::int32_t row = 0; row < finer.height / 2; ++row, to += stride) {
    const LogOdds8* low = finer.pixels + 2 * row * finer.stride;
    const LogOdds8* high = low + finer.stride;
    for (std::int32_t column = 0; column < finer.width / 2; ++column) {
      // kUnobserved is the smallest number, so it loses against everything.
      to[column] = std::max(std::max(low[2 * column], low[2 * column + 1]),
                            std::max(high[2 * column], high[2 * column + 1]));
    }
  }
}

// Renders into canvases of any resolution, by drawing where a pixel is no larger than a cell of the
// textures and by taking maxima over pixels of half the size elsewhere.
class Painter {
 public:
  explicit Painter(double texel_m) : texel_m_(texel_m), draw_span_(FastestSpanFunction()) {}

  void Paint(const std::vector<const Drawable*>& candidates, const Canvas& canvas) const {
    std::vector<const Drawable*> under;
    const BoxInMap box = canvas.Box();
    for (const Drawable* drawable : candidates) {
      if (drawable->box.Intersects(box)) {
        under.push_back(drawable);
      }
    }
    for (std::int32_t row = 0; row < canvas.height; ++row) {
      std::fill_n(canvas.pixels + row * canvas.stride, canvas.width, kUnobserved);
    }
    if (under.empty()) {
      return;
    }
    // A hair of tolerance: 0.05 m is not the same number however it is reached.
    if (canvas.resolution_m > texel_m_ * (1.0 + 1e-9)) {
      PaintByHalves(under, canvas);
      return;
    }
    for (const Drawable* drawable : under) {
      Draw(drawable->polygon, canvas, draw_span_);
    }
  }

 private:
  void PaintByHalves(const std::vector<const Drawable*>& candidates, const Canvas& canvas) const {
    constexpr std::int32_t kHalf = Canvas::kSideMax / 2;
    std::vector<LogOdds8> pixels(static_cast<std::size_t>(Canvas::kSideMax) * Canvas::kSideMax);
    for (std::int32_t y = 0; y < canvas.height; y += kHalf) {
      for (std::int32_t x = 0; x < canvas.width; x += kHalf) {
        Canvas finer;
        finer.origin_in_map = canvas.origin_in_map + Eigen::Vector2d(x, y) * canvas.resolution_m;
        finer.resolution_m = 0.5 * canvas.resolution_m;
        finer.width = 2 * std::min(kHalf, canvas.width - x);
        finer.height = 2 * std::min(kHalf, canvas.height - y);
        finer.pixels = pixels.data();
        finer.stride = finer.width;
        Paint(candidates, finer);
        TakeMaxima(finer, canvas.pixels + y * canvas.stride + x, canvas.stride);
      }
    }
  }

  double texel_m_;  // side of the cells of the textures
  DrawSpanFunction draw_span_;
};

// Small pictures are made from the coarse textures.
bool NeedsCoarse(const Snapshot& snapshot, double resolution_m) {
  return resolution_m >= snapshot.settings.cell_size_m * LtrTexture::kCoarseSide * (1.0 - 1e-9);
}

double TexelM(const Snapshot& snapshot, bool coarse) {
  return snapshot.settings.cell_size_m * (coarse ? LtrTexture::kCoarseSide : 1);
}

}  // namespace

TileImage RenderTile(const Snapshot& snapshot, Layer layer, const TileAddress& address) {
  LOCI_CHECK(Validate(address).ok());
  const BoxInMap box = BoxOf(address);
  const bool coarse = NeedsCoarse(snapshot, PixelSideM(address.zoom));
  const Scene scene(snapshot, {layer, box, false, coarse});
  TileImage tile;
  Canvas canvas;
  canvas.origin_in_map = box.min;
  canvas.resolution_m = PixelSideM(address.zoom);
  canvas.width = kTileSide;
  canvas.height = kTileSide;
  // From the last row of the picture upwards.
  canvas.pixels = tile.pixels.data() + static_cast<std::ptrdiff_t>(kTileSide) * (kTileSide - 1);
  canvas.stride = -kTileSide;
  Painter(TexelM(snapshot, coarse)).Paint(scene.drawables(), canvas);
  return tile;
}

RasterImage RenderRegion(const Snapshot& snapshot, Layer layer, const RasterRegion& region) {
  LOCI_CHECK(region.resolution_m > 0.0 && region.width >= 1 && region.height >= 1);
  BoxInMap box;
  box.Extend(region.origin_in_map);
  box.Extend(region.origin_in_map +
             Eigen::Vector2d(region.width, region.height) * region.resolution_m);
  const bool coarse = NeedsCoarse(snapshot, region.resolution_m);
  const Scene scene(snapshot, {layer, box, false, coarse});
  const Painter painter(TexelM(snapshot, coarse));
  RasterImage image;
  image.width = region.width;
  image.height = region.height;
  image.pixels.resize(static_cast<std::size_t>(region.width) *
                      static_cast<std::size_t>(region.height));
  for (std::int32_t y = 0; y < region.height; y += Canvas::kSideMax) {
    for (std::int32_t x = 0; x < region.width; x += Canvas::kSideMax) {
      Canvas canvas;
      canvas.origin_in_map = region.origin_in_map + Eigen::Vector2d(x, y) * region.resolution_m;
      canvas.resolution_m = region.resolution_m;
      canvas.width = std::min(Canvas::kSideMax, region.width - x);
      canvas.height = std::min(Canvas::kSideMax, region.height - y);
      canvas.pixels = image.pixels.data() + static_cast<std::ptrdiff_t>(y) * region.width + x;
      canvas.stride = region.width;
      painter.Paint(scene.drawables(), canvas);
    }
  }
  return image;
}

}  // namespace loci
