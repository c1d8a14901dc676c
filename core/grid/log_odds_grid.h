// SPDX-License-Identifier: Apache-2.0
// A growing occupancy grid of one byte per cell, in blocks that snapshots share.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/archive.h"

namespace loci {

// Log-odds in fixed point: one unit is kLogOddsPerUnit. kUnobserved marks a cell that no beam met.
using LogOdds8 = std::int8_t;
inline constexpr LogOdds8 kUnobserved = -128;
inline constexpr double kLogOddsPerUnit = 0.04;
// Clamps of design.md section 4.7: +-2 in a place, +-4 in an LTR.
inline constexpr int kPlaceLogOddsMax = 50;
inline constexpr int kLtrLogOddsMax = 100;

// Index of a cell: its lower left corner is (x, y) * cell_size in the grid's frame. May be
// negative.
struct CellIndex {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend bool operator==(const CellIndex&, const CellIndex&) = default;
};

// Half-open box of cells [min, max).
struct CellBox {
  CellIndex min;
  CellIndex max;
  bool Empty() const { return min.x >= max.x || min.y >= max.y; }
};

// An unbounded grid of LogOdds8, held as square blocks that exist where something was written.
//
// Copying shares the blocks: `Share()` gives a copy that never changes, at the cost of one pointer
// per block; the next write to a block copies that block. One thread writes; any thread may read a
// shared copy.
class LogOddsGrid {
 public:
  static constexpr std::int32_t kBlockBits = 6;
  static constexpr std::int32_t kBlockSide = 1 << kBlockBits;
  static constexpr std::int32_t kBlockMask = kBlockSide - 1;

  struct Block {
    std::uint32_t epoch = 0;  // of the grid that may write to it; not part of the state
    std::array<LogOdds8, kBlockSide * kBlockSide> cells;
  };

  // kUnobserved where nothing was written.
  LogOdds8 At(CellIndex cell) const {
    const Block* block = FindBlock({cell.x >> kBlockBits, cell.y >> kBlockBits});
    return block == nullptr ? kUnobserved : block->cells[OffsetOf(cell)];
  }

  // The cell, for writing.
  LogOdds8& Writable(CellIndex cell) {
    return WritableBlock({cell.x >> kBlockBits, cell.y >> kBlockBits}).cells[OffsetOf(cell)];
  }

  // Block (bx, by) covers cells [bx * 64, bx * 64 + 64) and likewise in y. Null if never written.
  const Block* FindBlock(CellIndex block) const {
    const std::int32_t column = block.x - first_.x;
    const std::int32_t row = block.y - first_.y;
    if (column < 0 || row < 0 || column >= columns_ || row >= rows_) {
      return nullptr;
    }
    return blocks_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(column)]
        .get();
  }
  Block& WritableBlock(CellIndex block);

  // Position of a cell in its block's `cells`.
  static std::size_t OffsetOf(CellIndex cell) {
    return static_cast<std::size_t>(((cell.y & kBlockMask) << kBlockBits) | (cell.x & kBlockMask));
  }

  // Box of all blocks, in cells; empty for an empty grid.
  CellBox Bounds() const;
  std::size_t BlockCount() const;

  // A copy that stays as the grid is now.
  LogOddsGrid Share();

  template <typename Archive>
  friend void Fields(Archive& archive, LogOddsGrid& grid) {
    grid.VisitFields(archive);
  }

 private:
  template <typename Archive>
  void VisitFields(Archive& archive);
  void Grow(CellIndex block);
  static CellBox Extended(const CellBox& extent, CellIndex block);
  // Whether a grid can reach from the block `extent.min` to `extent.max`; if not, the bytes are
  // damaged and must not allocate.
  static bool IsPossible(const CellBox& extent);

  CellIndex first_;  // block at blocks_[0]
  std::int32_t columns_ = 0;
  std::int32_t rows_ = 0;
  std::uint32_t epoch_ = 1;
  std::vector<std::shared_ptr<Block>> blocks_;  // row-major, null where nothing was written
};

// Blocks are stored in order of (y, x), so that the bytes do not depend on how the grid grew.
template <typename Archive>
void LogOddsGrid::VisitFields(Archive& archive) {
  std::uint32_t count = static_cast<std::uint32_t>(BlockCount());
  archive(count);
  if constexpr (Archive::kReads) {
    *this = LogOddsGrid();
    CellIndex before;
    CellBox extent;
    for (std::uint32_t i = 0; i < count; ++i) {
      CellIndex block;
      archive(block.x, block.y);
      extent = i == 0 ? CellBox{block, block} : Extended(extent, block);
      // The order also ends the loop when the bytes do: zeros that are read then come twice.
      const bool in_order =
          i == 0 || block.y > before.y || (block.y == before.y && block.x > before.x);
      if (!in_order || !IsPossible(extent)) {
        archive.Fail();
        return;
      }
      before = block;
      Block& written = WritableBlock(block);
      archive.Raw(written.cells.data(), written.cells.size());
    }
  } else {
    for (std::int32_t row = 0; row < rows_; ++row) {
      for (std::int32_t column = 0; column < columns_; ++column) {
        const CellIndex block{first_.x + column, first_.y + row};
        if (const Block* found = FindBlock(block); found != nullptr) {
          archive(block.x, block.y);
          archive.Raw(found->cells.data(), found->cells.size());
        }
      }
    }
  }
}

}  // namespace loci
