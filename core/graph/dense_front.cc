// SPDX-License-Identifier: Apache-2.0
// Blocked elimination with vectors of four; AVX2 where the processor has it, with the same bits.
#include "core/graph/dense_front.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace loci {
namespace {

using Vector4 [[gnu::vector_size(32)]] = double;

// Columns that are eliminated before the rest of the front is brought up to date.
constexpr std::ptrdiff_t kPanelColumns = 16;

// Inlined into functions for different processors, as all that follows.
[[gnu::always_inline]] inline void Load(const double* from, Vector4& to) {
  std::memcpy(&to, from, sizeof(to));
}
[[gnu::always_inline]] inline void Store(const Vector4& from, double* to) {
  std::memcpy(to, &from, sizeof(from));
}

// rows [begin, end) of a -= w * b, in fours from `begin`, which is a multiple of four.
[[gnu::always_inline]] inline void SubtractMultiple(
    const double* b, double w, std::ptrdiff_t begin, std::ptrdiff_t end, double* a) {
  for (std::ptrdiff_t i = begin; i < end; i += 4) {
    Vector4 x;
    Vector4 y;
    Load(b + i, x);
    Load(a + i, y);
    y -= w * x;
    Store(y, a + i);
  }
}

// Factorises columns [first, last) in all rows; the rest of the front stays as it is.
[[gnu::always_inline]] inline bool FactorPanel(double* front,
                                               std::ptrdiff_t size,
                                               std::ptrdiff_t first,
                                               std::ptrdiff_t last) {
  const std::ptrdiff_t stride = StrideOf(size);
  const std::ptrdiff_t rows = size + 1;
  for (std::ptrdiff_t k = first; k < last; ++k) {
    double* column = front + k * stride;
    const double pivot = column[k];
    if (!(pivot > 0.0) || !(pivot < 1e300)) {
      return false;
    }
    const double inverse = 1.0 / std::sqrt(pivot);
    for (std::ptrdiff_t i = k & ~std::ptrdiff_t{3}; i < rows; i += 4) {
      Vector4 x;
      Load(column + i, x);
      x *= inverse;
      Store(x, column + i);
    }
    for (std::ptrdiff_t j = k + 1; j < last; ++j) {
      SubtractMultiple(column, column[j], j & ~std::ptrdiff_t{3}, rows, front + j * stride);
    }
  }
  return true;
}

// Columns [j, j + 4) less what the panel [first, last) says, from row `begin` on, which is a
// multiple of four; kVectors of rows at a time.
template <std::size_t kVectors>
[[gnu::always_inline]] inline std::ptrdiff_t UpdateFour(double* front,
                                                        std::ptrdiff_t stride,
                                                        std::ptrdiff_t first,
                                                        std::ptrdiff_t last,
                                                        std::ptrdiff_t j,
                                                        std::ptrdiff_t begin,
                                                        std::ptrdiff_t rows) {
  constexpr std::ptrdiff_t kRows = 4 * static_cast<std::ptrdiff_t>(kVectors);
  std::ptrdiff_t i = begin;
  for (; i + kRows - 4 < rows; i += kRows) {
    Vector4 sum[kVectors][4] = {};
    for (std::ptrdiff_t k = first; k < last; ++k) {
      const double* column = front + k * stride;
      Vector4 x[kVectors];
      for (std::size_t v = 0; v < kVectors; ++v) {
        Load(column + i + 4 * v, x[v]);
      }
      for (std::size_t c = 0; c < 4; ++c) {
        const double w = column[j + static_cast<std::ptrdiff_t>(c)];
        for (std::size_t v = 0; v < kVectors; ++v) {
          sum[v][c] += w * x[v];
        }
      }
    }
    for (std::size_t c = 0; c < 4; ++c) {
      double* target = front + (j + static_cast<std::ptrdiff_t>(c)) * stride + i;
      for (std::size_t v = 0; v < kVectors; ++v) {
        Vector4 y;
        Load(target + 4 * v, y);
        y -= sum[v][c];
        Store(y, target + 4 * v);
      }
    }
  }
  return i;
}

[[gnu::always_inline]] inline void UpdateOne(double* front,
                                             std::ptrdiff_t stride,
                                             std::ptrdiff_t first,
                                             std::ptrdiff_t last,
                                             std::ptrdiff_t j,
                                             std::ptrdiff_t rows) {
  for (std::ptrdiff_t i = j & ~std::ptrdiff_t{3}; i < rows; i += 4) {
    Vector4 sum = {};
    for (std::ptrdiff_t k = first; k < last; ++k) {
      Vector4 x;
      Load(front + k * stride + i, x);
      sum += front[k * stride + j] * x;
    }
    Vector4 y;
    Load(front + j * stride + i, y);
    y -= sum;
    Store(y, front + j * stride + i);
  }
}

template <std::size_t kVectors>
[[gnu::always_inline]] inline bool Eliminate(double* front,
                                             std::ptrdiff_t size,
                                             std::ptrdiff_t columns) {
  const std::ptrdiff_t stride = StrideOf(size);
  const std::ptrdiff_t rows = size + 1;
  for (std::ptrdiff_t first = 0; first < columns; first += kPanelColumns) {
    const std::ptrdiff_t last = std::min(columns, first + kPanelColumns);
    if (!FactorPanel(front, size, first, last)) {
      return false;
    }
    std::ptrdiff_t j = last;
    for (; j + 4 <= size; j += 4) {
      const std::ptrdiff_t rest =
          UpdateFour<kVectors>(front, stride, first, last, j, j & ~std::ptrdiff_t{3}, rows);
      if constexpr (kVectors > 1) {
        UpdateFour<1>(front, stride, first, last, j, rest, rows);
      }
    }
    for (; j < size; ++j) {
      UpdateOne(front, stride, first, last, j, rows);
    }
  }
  return true;
}

// The sums over rows [begin, size) of what kColumns columns from k on say to x.
template <std::size_t kColumns>
[[gnu::always_inline]] inline void DotColumns(const double* column,
                                              std::ptrdiff_t stride,
                                              std::ptrdiff_t begin,
                                              std::ptrdiff_t size,
                                              const double* x,
                                              double* dots) {
  Vector4 sums[kColumns] = {};
  std::ptrdiff_t i = begin;
  for (; i + 4 <= size; i += 4) {
    Vector4 y;
    Load(x + i, y);
    for (std::size_t c = 0; c < kColumns; ++c) {
      Vector4 l;
      Load(column + static_cast<std::ptrdiff_t>(c) * stride + i, l);
      sums[c] += l * y;
    }
  }
  for (std::size_t c = 0; c < kColumns; ++c) {
    double sum = (sums[c][0] + sums[c][1]) + (sums[c][2] + sums[c][3]);
    for (std::ptrdiff_t j = i; j < size; ++j) {
      sum += column[static_cast<std::ptrdiff_t>(c) * stride + j] * x[j];
    }
    dots[c] = sum;
  }
}

// Solves columns [k, k + kColumns), of which all rows below are known.
template <std::size_t kColumns>
[[gnu::always_inline]] inline void SolveSome(
    const double* front, std::ptrdiff_t stride, std::ptrdiff_t k, std::ptrdiff_t size, double* x) {
  constexpr auto kCount = static_cast<std::ptrdiff_t>(kColumns);
  const double* columns = front + k * stride;
  double dots[kColumns];
  DotColumns<kColumns>(columns, stride, k + kCount, size, x, dots);
  for (std::ptrdiff_t c = kCount - 1; c >= 0; --c) {
    const double* column = columns + c * stride;
    double sum = dots[c];
    for (std::ptrdiff_t r = c + 1; r < kCount; ++r) {
      sum += column[k + r] * x[k + r];
    }
    x[k + c] = (column[size] - sum) / column[k + c];
  }
}

[[gnu::always_inline]] inline void SolveAll(const double* front,
                                            std::ptrdiff_t size,
                                            std::ptrdiff_t columns,
                                            double* x) {
  const std::ptrdiff_t stride = StrideOf(size);
  std::ptrdiff_t k = columns;
  for (; k >= 3; k -= 3) {  // a pose in the plane at a time
    SolveSome<3>(front, stride, k - 3, size, x);
  }
  for (; k >= 1; --k) {
    SolveSome<1>(front, stride, k - 1, size, x);
  }
}

#ifdef __x86_64__
[[gnu::target("avx2")]] bool EliminateAvx2(double* front,
                                           std::ptrdiff_t size,
                                           std::ptrdiff_t columns) {
  return Eliminate<2>(front, size, columns);
}
[[gnu::target("avx2")]] void SolveAvx2(const double* front,
                                       std::ptrdiff_t size,
                                       std::ptrdiff_t columns,
                                       double* x) {
  SolveAll(front, size, columns, x);
}

bool HasAvx2() {
  static const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
  return has_avx2;
}
#endif

}  // namespace

bool EliminateColumnsPlainly(double* front, std::ptrdiff_t size, std::ptrdiff_t columns) {
  return Eliminate<1>(front, size, columns);
}

void SolveColumnsPlainly(const double* front,
                         std::ptrdiff_t size,
                         std::ptrdiff_t columns,
                         double* x) {
  SolveAll(front, size, columns, x);
}

bool EliminateColumns(double* front, std::ptrdiff_t size, std::ptrdiff_t columns) {
#ifdef __x86_64__
  if (HasAvx2()) {
    return EliminateAvx2(front, size, columns);
  }
#endif
  return EliminateColumnsPlainly(front, size, columns);
}

void SolveColumns(const double* front, std::ptrdiff_t size, std::ptrdiff_t columns, double* x) {
#ifdef __x86_64__
  if (HasAvx2()) {
    SolveAvx2(front, size, columns, x);
    return;
  }
#endif
  SolveColumnsPlainly(front, size, columns, x);
}

}  // namespace loci
