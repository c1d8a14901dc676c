// SPDX-License-Identifier: Apache-2.0
// What a place keeps of its laser: one mean below the cell size for each occupied cell.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/base/archive.h"
#include "core/grid/log_odds_grid.h"

namespace loci {

// An occupied cell of a patch. Points are in the frame of the place, in metres.
struct PatchCell {
  CellIndex cell;
  double sum_x_m = 0.0;  // of all points that fell into the cell
  double sum_y_m = 0.0;
  std::uint32_t hits = 0;      // points, reference content included
  std::uint32_t own_hits = 0;  // points seen from this place
  std::uint32_t misses = 0;    // key scans that saw through the cell

  Eigen::Vector2d Mean() const { return Eigen::Vector2d(sum_x_m, sum_y_m) / hits; }
};

template <typename Archive>
void Fields(Archive& archive, PatchCell& cell) {
  archive(cell.cell.x, cell.cell.y, cell.sum_x_m, cell.sum_y_m);
  archive(cell.hits, cell.own_hits, cell.misses);
}

// What registration needs of a cell: its mean, and how much that counts.
struct PatchPoint {
  double x_m = 0.0;
  double y_m = 0.0;
  // The number of hits, at most kWeightMax: more say no more about where a surface is.
  double weight = 0.0;

  static constexpr double kWeightMax = 5.0;
};

// Whether points are the place's own view or were handed over from the place before.
enum class PatchContent : std::uint8_t { kOwn, kReference };

// The occupied cells of a place, found by their index. Movable; the lookup from index to cell is a
// cache that is made from the cells.
class Patch {
 public:
  explicit Patch(double cell_size_m = 0.05) : cell_size_m_(cell_size_m) {}

  // Returns true if the point's cell was empty before.
  bool Add(const Eigen::Vector2d& point_in_place, PatchContent content);
  void AddMiss(std::size_t index) { ++cells_[index].misses; }

  double cell_size_m() const { return cell_size_m_; }
  // In order of first observation.
  std::span<const PatchCell> cells() const { return cells_; }

  // Position in cells(), or -1.
  std::int32_t Find(CellIndex cell) const {
    const LookupBlock* block = FindLookupBlock(cell.x >> kBits, cell.y >> kBits);
    return block == nullptr ? -1 : (*block)[OffsetOf(cell)];
  }

  // Calls `visit(const PatchPoint&)` for each occupied cell at most `reach` cells from
  // `center` in x and in y, row by row.
  template <typename Visitor>
  void VisitSquare(CellIndex center, std::int32_t reach, Visitor&& visit) const;

  // Means of the cells that were hit at least `hits_min` times, in order of first observation.
  std::vector<Eigen::Vector2d> Means(std::uint32_t hits_min) const;

  template <typename Archive>
  friend void Fields(Archive& archive, Patch& patch) {
    archive(patch.cell_size_m_, patch.cells_);
    if constexpr (Archive::kReads) {
      if (!patch.RebuildLookup()) {
        archive.Fail();
      }
    }
  }

 private:
  static constexpr std::int32_t kBits = 4;
  static constexpr std::int32_t kSide = 1 << kBits;
  using LookupBlock = std::array<std::int32_t, kSide * kSide>;

  static std::size_t OffsetOf(CellIndex cell) {
    return static_cast<std::size_t>(((cell.y & (kSide - 1)) << kBits) | (cell.x & (kSide - 1)));
  }
  std::int32_t& LookupSlot(CellIndex cell);
  void GrowLookup(CellIndex block);
  // Of a block of the lookup, null where no cell is occupied.
  const LookupBlock* FindLookupBlock(std::int32_t x, std::int32_t y) const {
    const std::int32_t column = x - first_.x;
    const std::int32_t row = y - first_.y;
    if (column < 0 || row < 0 || column >= columns_ || row >= rows_) {
      return nullptr;
    }
    return lookup_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)]
        .get();
  }
  void UpdatePoint(std::size_t index);
  // False if the cells cannot be those of a patch.
  bool RebuildLookup();

  double cell_size_m_;
  std::vector<PatchCell> cells_;
  std::vector<PatchPoint> points_;  // cache: one for each cell
  CellIndex first_;                 // block of lookup_[0]
  std::int32_t columns_ = 0;
  std::int32_t rows_ = 0;
  std::vector<std::unique_ptr<LookupBlock>> lookup_;
};

template <typename Visitor>
void Patch::VisitSquare(CellIndex center, std::int32_t reach, Visitor&& visit) const {
  const std::int32_t x_last = center.x + reach;
  for (std::int32_t y = center.y - reach; y <= center.y + reach; ++y) {
    for (std::int32_t x = center.x - reach; x <= x_last;) {
      const std::int32_t x_end = std::min(x_last + 1, ((x >> kBits) + 1) << kBits);
      const LookupBlock* block = FindLookupBlock(x >> kBits, y >> kBits);
      if (block == nullptr) {
        x = x_end;
        continue;
      }
      const std::int32_t* slots = block->data() + OffsetOf({x, y});
      for (; x < x_end; ++x, ++slots) {
        if (*slots >= 0) {
          visit(points_[static_cast<std::size_t>(*slots)]);
        }
      }
    }
  }
}

}  // namespace loci
