// SPDX-License-Identifier: Apache-2.0
#include "core/tile/span.h"

#include <algorithm>

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#define LOCI_HAS_X86_SPANS 1
#ifndef __clang__
// GCC 12 warns of its own AVX-512 intrinsics, which begin from a value left undefined on purpose.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#else
#define LOCI_HAS_X86_SPANS 0
#endif

namespace loci {
namespace {

// Adds without the undefined overflow of signed numbers: lanes past the end may wrap.
std::int32_t Advance(std::int32_t start, std::int32_t step, std::int32_t count) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(start) +
                                   static_cast<std::uint32_t>(step) *
                                       static_cast<std::uint32_t>(count));
}

void DrawScalar(const Span& span, LogOdds8* pixels, std::int32_t count) {
  const TextureView& texture = span.texture;
  for (std::int32_t i = 0; i < count; ++i) {
    const std::int32_t column =
        std::clamp(Advance(span.u, span.du, i) >> 16, 0, texture.column_count - 1);
    const std::int32_t row =
        std::clamp(Advance(span.v, span.dv, i) >> 16, 0, texture.row_count - 1);
    pixels[i] = AddLogOdds(pixels[i], texture.cells[row * texture.column_count + column]);
  }
}

#if LOCI_HAS_X86_SPANS

// AddLogOdds for 16 pixels.
__attribute__((target("sse4.1"))) inline __m128i AddLogOdds16(__m128i pixels, __m128i more) {
  const __m128i unobserved = _mm_set1_epi8(kUnobserved);
  __m128i sum = _mm_adds_epi8(pixels, more);
  sum = _mm_min_epi8(sum, _mm_set1_epi8(kLtrLogOddsMax));
  sum = _mm_max_epi8(sum, _mm_set1_epi8(-kLtrLogOddsMax));
  sum = _mm_blendv_epi8(sum, more, _mm_cmpeq_epi8(pixels, unobserved));
  return _mm_blendv_epi8(sum, pixels, _mm_cmpeq_epi8(more, unobserved));
}

// The cells at eight positions, one in the low byte of each lane.
__attribute__((target("avx2"))) inline __m256i Fetch8(const TextureView& texture,
                                                      __m256i u,
                                                      __m256i v) {
  const __m256i zero = _mm256_setzero_si256();
  const __m256i column = _mm256_min_epi32(_mm256_max_epi32(_mm256_srai_epi32(u, 16), zero),
                                          _mm256_set1_epi32(texture.column_count - 1));
  const __m256i row = _mm256_min_epi32(_mm256_max_epi32(_mm256_srai_epi32(v, 16), zero),
                                       _mm256_set1_epi32(texture.row_count - 1));
  const __m256i index =
      _mm256_add_epi32(_mm256_mullo_epi32(row, _mm256_set1_epi32(texture.column_count)), column);
  const __m256i word = _mm256_i32gather_epi32(
      reinterpret_cast<const int*>(texture.cells), _mm256_srli_epi32(index, 2), 4);
  const __m256i shift = _mm256_slli_epi32(_mm256_and_si256(index, _mm256_set1_epi32(3)), 3);
  return _mm256_srlv_epi32(word, shift);
}

__attribute__((target("avx2"))) void DrawAvx2(const Span& span,
                                              LogOdds8* pixels,
                                              std::int32_t count) {
  const __m256i lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256i step_u = _mm256_set1_epi32(Advance(0, span.du, 8));
  const __m256i step_v = _mm256_set1_epi32(Advance(0, span.dv, 8));
  __m256i u = _mm256_add_epi32(_mm256_set1_epi32(span.u),
                               _mm256_mullo_epi32(lanes, _mm256_set1_epi32(span.du)));
  __m256i v = _mm256_add_epi32(_mm256_set1_epi32(span.v),
                               _mm256_mullo_epi32(lanes, _mm256_set1_epi32(span.dv)));
  // Low bytes of the lanes of each half, moved together.
  const __m256i low_bytes = _mm256_setr_epi8(0,
                                             4,
                                             8,
                                             12,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             0,
                                             4,
                                             8,
                                             12,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1,
                                             -1);
  std::int32_t i = 0;
  for (; i + 16 <= count; i += 16) {
    const __m256i first = _mm256_shuffle_epi8(Fetch8(span.texture, u, v), low_bytes);
    u = _mm256_add_epi32(u, step_u);
    v = _mm256_add_epi32(v, step_v);
    const __m256i second = _mm256_shuffle_epi8(Fetch8(span.texture, u, v), low_bytes);
    u = _mm256_add_epi32(u, step_u);
    v = _mm256_add_epi32(v, step_v);
    const __m128i low =
        _mm_unpacklo_epi32(_mm256_castsi256_si128(first), _mm256_extracti128_si256(first, 1));
    const __m128i high =
        _mm_unpacklo_epi32(_mm256_castsi256_si128(second), _mm256_extracti128_si256(second, 1));
    auto* at = reinterpret_cast<__m128i*>(pixels + i);
    _mm_storeu_si128(at, AddLogOdds16(_mm_loadu_si128(at), _mm_unpacklo_epi64(low, high)));
  }
  Span rest = span;
  rest.u = Advance(span.u, span.du, i);
  rest.v = Advance(span.v, span.dv, i);
  DrawScalar(rest, pixels + i, count - i);
}

__attribute__((target("avx512f,avx512bw,avx512vl,avx512dq"))) void DrawAvx512(const Span& span,
                                                                              LogOdds8* pixels,
                                                                              std::int32_t count) {
  const TextureView& texture = span.texture;
  const __m512i lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const __m512i step_u = _mm512_set1_epi32(Advance(0, span.du, 16));
  const __m512i step_v = _mm512_set1_epi32(Advance(0, span.dv, 16));
  const __m512i zero = _mm512_setzero_si512();
  const __m512i last_column = _mm512_set1_epi32(texture.column_count - 1);
  const __m512i last_row = _mm512_set1_epi32(texture.row_count - 1);
  const __m512i column_count = _mm512_set1_epi32(texture.column_count);
  __m512i u = _mm512_add_epi32(_mm512_set1_epi32(span.u),
                               _mm512_mullo_epi32(lanes, _mm512_set1_epi32(span.du)));
  __m512i v = _mm512_add_epi32(_mm512_set1_epi32(span.v),
                               _mm512_mullo_epi32(lanes, _mm512_set1_epi32(span.dv)));
  for (std::int32_t i = 0; i < count; i += 16) {
    const __m512i column =
        _mm512_min_epi32(_mm512_max_epi32(_mm512_srai_epi32(u, 16), zero), last_column);
    const __m512i row =
        _mm512_min_epi32(_mm512_max_epi32(_mm512_srai_epi32(v, 16), zero), last_row);
    const __m512i index = _mm512_add_epi32(_mm512_mullo_epi32(row, column_count), column);
    const __m512i word = _mm512_i32gather_epi32(_mm512_srli_epi32(index, 2), texture.cells, 4);
    const __m512i shift = _mm512_slli_epi32(_mm512_and_si512(index, _mm512_set1_epi32(3)), 3);
    const __m128i more = _mm512_cvtepi32_epi8(_mm512_srlv_epi32(word, shift));
    u = _mm512_add_epi32(u, step_u);
    v = _mm512_add_epi32(v, step_v);
    const std::int32_t left = count - i;
    const auto mask = static_cast<__mmask16>(left >= 16 ? 0xFFFF : (1 << left) - 1);
    const __m128i before = _mm_maskz_loadu_epi8(mask, pixels + i);
    _mm_mask_storeu_epi8(pixels + i, mask, AddLogOdds16(before, more));
  }
}

#endif

}  // namespace

DrawSpanFunction SpanFunctionOf(SpanVariant variant) {
  switch (variant) {
    case SpanVariant::kScalar:
      return DrawScalar;
#if LOCI_HAS_X86_SPANS
    case SpanVariant::kAvx2:
      return __builtin_cpu_supports("avx2") ? DrawAvx2 : nullptr;
    case SpanVariant::kAvx512:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                     __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq")
                 ? DrawAvx512
                 : nullptr;
#else
    case SpanVariant::kAvx2:
    case SpanVariant::kAvx512:
      return nullptr;
#endif
  }
  return nullptr;
}

DrawSpanFunction FastestSpanFunction() {
  static const DrawSpanFunction fastest = [] {
    for (const SpanVariant variant : {SpanVariant::kAvx512, SpanVariant::kAvx2}) {
      if (const DrawSpanFunction found = SpanFunctionOf(variant); found != nullptr) {
        return found;
      }
    }
    return SpanFunctionOf(SpanVariant::kScalar);
  }();
  return fastest;
}

}  // namespace loci
