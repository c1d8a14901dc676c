// SPDX-License-Identifier: Apache-2.0
#include "core/grid/log_odds_grid.h"

#include <algorithm>

namespace loci {

LogOddsGrid::Block& LogOddsGrid::WritableBlock(CellIndex block) {
  const std::int32_t column = block.x - first_.x;
  const std::int32_t row = block.y - first_.y;
  if (column < 0 || row < 0 || column >= columns_ || row >= rows_) {
    Grow(block);
    return WritableBlock(block);
  }
  std::shared_ptr<Block>& slot =
      blocks_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
              static_cast<std::size_t>(column)];
  if (slot == nullptr) {
    slot = std::make_shared<Block>();
    slot->cells.fill(kUnobserved);
    slot->epoch = epoch_;
  } else if (slot->epoch != epoch_) {  // a snapshot may hold it
    slot = std::make_shared<Block>(*slot);
    slot->epoch = epoch_;
  }
  return *slot;
}

void LogOddsGrid::Grow(CellIndex block) {
  if (blocks_.empty()) {
    first_ = block;
    columns_ = 1;
    rows_ = 1;
    blocks_.resize(1);
    return;
  }
  const CellIndex low{std::min(first_.x, block.x), std::min(first_.y, block.y)};
  const std::int32_t columns = std::max(first_.x + columns_, block.x + 1) - low.x;
  const std::int32_t rows = std::max(first_.y + rows_, block.y + 1) - low.y;
  std::vector<std::shared_ptr<Block>> grown(static_cast<std::size_t>(columns) *
                                            static_cast<std::size_t>(rows));
  for (std::int32_t row = 0; row < rows_; ++row) {
    for (std::int32_t column = 0; column < columns_; ++column) {
      const std::size_t to =
          static_cast<std::size_t>(row + first_.y - low.y) * static_cast<std::size_t>(columns) +
          static_cast<std::size_t>(column + first_.x - low.x);
      grown[to] =
          std::move(blocks_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                            static_cast<std::size_t>(column)]);
    }
  }
  first_ = low;
  columns_ = columns;
  rows_ = rows;
  blocks_ = std::move(grown);
}

CellBox LogOddsGrid::Bounds() const {
  if (blocks_.empty()) {
    return {};
  }
  return {{first_.x * kBlockSide, first_.y * kBlockSide},
          {(first_.x + columns_) * kBlockSide, (first_.y + rows_) * kBlockSide}};
}

std::size_t LogOddsGrid::BlockCount() const {
  return static_cast<std::size_t>(
      std::count_if(blocks_.begin(), blocks_.end(), [](const auto& b) { return b != nullptr; }));
}

CellBox LogOddsGrid::Extended(const CellBox& extent, CellIndex block) {
  return {{std::min(extent.min.x, block.x), std::min(extent.min.y, block.y)},
          {std::max(extent.max.x, block.x), std::max(extent.max.y, block.y)}};
}

bool LogOddsGrid::IsPossible(const CellBox& extent) {
  // A place spans a few hundred metres at most: 655 m at the smallest cells of 0.01 m. Blocks lie
  // within 10 km of its origin.
  constexpr std::int32_t kFarthest = 1 << 14;
  constexpr std::int32_t kSpanMax = 1 << 10;
  return extent.min.x >= -kFarthest && extent.min.y >= -kFarthest && extent.max.x <= kFarthest &&
         extent.max.y <= kFarthest && extent.max.x - extent.min.x <= kSpanMax &&
         extent.max.y - extent.min.y <= kSpanMax;
}

LogOddsGrid LogOddsGrid::Share() {
  LogOddsGrid shared = *this;
  ++epoch_;  // from now on this grid copies a block before it writes to it
  return shared;
}

}  // namespace loci
