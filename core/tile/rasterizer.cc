// SPDX-License-Identifier: Apache-2.0
#include "core/tile/rasterizer.h"

#include <algorithm>
#include <limits>

#include "core/base/check.h"

namespace loci {
namespace {

// For each row of a canvas, where the polygon begins and ends, in pixels.
struct Outline {
  std::array<double, Canvas::kSideMax> begin;
  std::array<double, Canvas::kSideMax> end;
};

// The first pixel or row whose centre is at `x` or beyond, within [0, limit]. (std::ceil is a call
// into the library on processors without SSE 4.1, and costs more than the row.)
std::int32_t FirstCentreFrom(double x, std::int32_t limit) {
  const double at = x - 0.5;
  if (!(at > 0.0)) {
    return 0;
  }
  if (at >= static_cast<double>(limit)) {
    return limit;
  }
  const auto below = static_cast<std::int32_t>(at);
  return below + (static_cast<double>(below) < at ? 1 : 0);
}

// Marks where an edge crosses the rows. It is always followed from its lower end, so that both
// polygons beside it get the same crossings.
void TraceEdge(const Eigen::Vector2d& from,
               const Eigen::Vector2d& to,
               std::int32_t height,
               Outline& outline) {
  if (from.y() == to.y()) {
    return;
  }
  const bool goes_up = from.y() < to.y();
  const Eigen::Vector2d& low = goes_up ? from : to;
  const Eigen::Vector2d& high = goes_up ? to : from;
  const double slope = (high.x() - low.x()) / (high.y() - low.y());
  // The inside lies to the left of an edge: going up, the edge ends the rows.
  std::array<double, Canvas::kSideMax>& crossings = goes_up ? outline.end : outline.begin;
  const std::int32_t last = FirstCentreFrom(high.y(), height);
  for (std::int32_t row = FirstCentreFrom(low.y(), height); row < last; ++row) {
    crossings[static_cast<std::size_t>(row)] = low.x() + (row + 0.5 - low.y()) * slope;
  }
}

// 16.16 fixed point. The limit is out of reach where it counts: a step that large leaves the
// texture within one pixel.
std::int32_t ToFixed(double cells) {
  const double fixed = std::clamp(cells, -16000.0, 16000.0) * 65536.0;
  const auto truncated = static_cast<std::int32_t>(fixed);
  return truncated - (fixed < static_cast<double>(truncated) ? 1 : 0);
}

}  // namespace

BoxInMap Canvas::Box() const {
  BoxInMap box;
  box.Extend(origin_in_map);
  box.Extend(origin_in_map + Eigen::Vector2d(width, height) * resolution_m);
  return box;
}

void Draw(const TexturedPolygon& polygon, const Canvas& canvas, DrawSpanFunction draw_span) {
  LOCI_DCHECK(canvas.width <= Canvas::kSideMax && canvas.height <= Canvas::kSideMax);
  if (!(polygon.map_from_texture.Determinant() > 0.0)) {
    return;
  }
  std::array<Eigen::Vector2d, 4> corners;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (std::size_t i = 0; i < polygon.corner_count; ++i) {
    corners[i] = (polygon.corners_in_map[i] - canvas.origin_in_map) / canvas.resolution_m;
    low = std::min(low, corners[i].y());
    high = std::max(high, corners[i].y());
  }
  Outline outline;
  for (std::size_t i = 0; i < polygon.corner_count; ++i) {
    TraceEdge(corners[i], corners[(i + 1) % polygon.corner_count], canvas.height, outline);
  }
  Affine2 canvas_from_texture = polygon.map_from_texture;
  canvas_from_texture.origin =
      (polygon.map_from_texture.origin - canvas.origin_in_map) / canvas.resolution_m;
  canvas_from_texture.x_axis /= canvas.resolution_m;
  canvas_from_texture.y_axis /= canvas.resolution_m;
  const Affine2 texture_from_canvas = Inverse(canvas_from_texture);
  Span span;
  span.texture = polygon.texture;
  span.du = ToFixed(texture_from_canvas.x_axis.x());
  span.dv = ToFixed(texture_from_canvas.x_axis.y());
  const DrawSpanFunction draw =
      polygon.texture.has_whole_words ? draw_span : SpanFunctionOf(SpanVariant::kScalar);
  const std::int32_t last_row = FirstCentreFrom(high, canvas.height);
  for (std::int32_t row = FirstCentreFrom(low, canvas.height); row < last_row; ++row) {
    const auto at_row = static_cast<std::size_t>(row);
    const std::int32_t begin = FirstCentreFrom(outline.begin[at_row], canvas.width);
    const std::int32_t end = FirstCentreFrom(outline.end[at_row], canvas.width);
    if (begin < end) {
      const Eigen::Vector2d at = texture_from_canvas * Eigen::Vector2d(begin + 0.5, row + 0.5);
      span.u = ToFixed(at.x());
      span.v = ToFixed(at.y());
      draw(span, canvas.pixels + row * canvas.stride + begin, end - begin);
    }
  }
}

}  // namespace loci
