// SPDX-License-Identifier: Apache-2.0
// The inner loop of drawing: one row of pixels through one texture.
#pragma once

#include <cstdint>

#include "core/grid/log_odds_grid.h"

namespace loci {

// Cells of a texture, row-major.
struct TextureView {
  const LogOdds8* cells = nullptr;
  std::int32_t column_count = 0;
  std::int32_t row_count = 0;
  // The memory reaches to a multiple of four cells, so that it may be read in words.
  bool has_whole_words = false;
};

// Pixel i shows the cell (column, row) = (u + i du, v + i dv) / 65536, rounded down and held within
// the texture.
struct Span {
  TextureView texture;
  std::int32_t u = 0;
  std::int32_t v = 0;
  std::int32_t du = 0;
  std::int32_t dv = 0;
};

// What pixels show where two things lie on each other.
inline LogOdds8 AddLogOdds(LogOdds8 pixel, LogOdds8 more) {
  if (more == kUnobserved) {
    return pixel;
  }
  if (pixel == kUnobserved) {
    return more;
  }
  const int sum = pixel + more;
  return static_cast<LogOdds8>(
      sum > kLtrLogOddsMax ? kLtrLogOddsMax : (sum < -kLtrLogOddsMax ? -kLtrLogOddsMax : sum));
}

// Adds the texture to `count` pixels.
using DrawSpanFunction = void (*)(const Span& span, LogOdds8* pixels, std::int32_t count);

// All of them give the same pixels; the processor decides which can run.
enum class SpanVariant : std::uint8_t { kScalar, kAvx2, kAvx512 };
// Null if this processor cannot run it.
DrawSpanFunction SpanFunctionOf(SpanVariant variant);
// The fastest that this processor can run.
DrawSpanFunction FastestSpanFunction();

}  // namespace loci
