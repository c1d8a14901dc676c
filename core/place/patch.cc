// SPDX-License-Identifier: Apache-2.0
#include "core/place/patch.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/grid/occupancy_grid.h"

namespace loci {

bool Patch::Add(const Eigen::Vector2d& point_in_place, PatchContent content) {
  const CellIndex index = CellOf(point_in_place, cell_size_m_);
  std::int32_t& slot = LookupSlot(index);
  const bool is_new = slot < 0;
  if (is_new) {
    slot = static_cast<std::int32_t>(cells_.size());
    cells_.push_back({.cell = index});
    points_.emplace_back();
  }
  PatchCell& cell = cells_[static_cast<std::size_t>(slot)];
  cell.sum_x_m += point_in_place.x();
  cell.sum_y_m += point_in_place.y();
  ++cell.hits;
  if (content == PatchContent::kOwn) {
    ++cell.own_hits;
  }
  UpdatePoint(static_cast<std::size_t>(slot));
  return is_new;
}

void Patch::UpdatePoint(std::size_t index) {
  const PatchCell& cell = cells_[index];
  const Eigen::Vector2d mean = cell.Mean();
  points_[index] = {
      mean.x(), mean.y(), std::min(static_cast<double>(cell.hits), PatchPoint::kWeightMax)};
}

std::vector<Eigen::Vector2d> Patch::Means(std::uint32_t hits_min) const {
  std::vector<Eigen::Vector2d> means;
  means.reserve(cells_.size());
  for (const PatchCell& cell : cells_) {
    if (cell.hits >= hits_min) {
      means.push_back(cell.Mean());
    }
  }
  return means;
}

std::int32_t& Patch::LookupSlot(CellIndex cell) {
  const CellIndex block{cell.x >> kBits, cell.y >> kBits};
  const std::int32_t column = block.x - first_.x;
  const std::int32_t row = block.y - first_.y;
  if (column < 0 || row < 0 || column >= columns_ || row >= rows_) {
    GrowLookup(block);
    return LookupSlot(cell);
  }
  std::unique_ptr<LookupBlock>& found =
      lookup_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
              static_cast<std::size_t>(column)];
  if (found == nullptr) {
    found = std::make_unique<LookupBlock>();
    found->fill(-1);
  }
  return (*found)[OffsetOf(cell)];
}

void Patch::GrowLookup(CellIndex block) {
  if (lookup_.empty()) {
    first_ = block;
    columns_ = 1;
    rows_ = 1;
    lookup_.resize(1);
    return;
  }
  const CellIndex low{std::min(first_.x, block.x), std::min(first_.y, block.y)};
  const std::int32_t columns = std::max(first_.x + columns_, block.x + 1) - low.x;
  const std::int32_t rows = std::max(first_.y + rows_, block.y + 1) - low.y;
  std::vector<std::unique_ptr<LookupBlock>> grown(static_cast<std::size_t>(columns) *
                                                  static_cast<std::size_t>(rows));
  for (std::int32_t row = 0; row < rows_; ++row) {
    for (std::int32_t column = 0; column < columns_; ++column) {
      grown[static_cast<std::size_t>(row + first_.y - low.y) * static_cast<std::size_t>(columns) +
            static_cast<std::size_t>(column + first_.x - low.x)] =
          std::move(lookup_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                            static_cast<std::size_t>(column)]);
    }
  }
  first_ = low;
  columns_ = columns;
  rows_ = rows;
  lookup_ = std::move(grown);
}

bool Patch::RebuildLookup() {
  first_ = {};
  columns_ = 0;
  rows_ = 0;
  lookup_.clear();
  points_.assign(cells_.size(), {});
  // Further than this is damage and must not allocate: content begins at most some 1100 m from the
  // place's origin (after driving blind) and spans a few hundred metres, at cells of 0.01 m or
  // more.
  constexpr std::int32_t kFarthest = 1 << 17;
  constexpr std::int32_t kSpanMax = 1 << 16;
  CellBox box{{kFarthest, kFarthest}, {-kFarthest, -kFarthest}};
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    const PatchCell& cell = cells_[i];
    box.min = {std::min(box.min.x, cell.cell.x), std::min(box.min.y, cell.cell.y)};
    box.max = {std::max(box.max.x, cell.cell.x), std::max(box.max.y, cell.cell.y)};
    const bool possible = box.min.x >= -kFarthest && box.min.y >= -kFarthest &&
                          box.max.x <= kFarthest && box.max.y <= kFarthest &&
                          box.max.x - box.min.x <= kSpanMax && box.max.y - box.min.y <= kSpanMax &&
                          cell.hits > 0 && std::isfinite(cell.sum_x_m) &&
                          std::isfinite(cell.sum_y_m);
    if (!possible) {
      return false;
    }
    std::int32_t& slot = LookupSlot(cell.cell);
    if (slot >= 0) {
      return false;
    }
    slot = static_cast<std::int32_t>(i);
    UpdatePoint(i);
  }
  return true;
}

}  // namespace loci
