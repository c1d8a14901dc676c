// SPDX-License-Identifier: Apache-2.0
#include "core/layer/ltr_layer.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "core/base/check.h"

namespace loci {
namespace {

bool ObservedBefore(const LtrContribution& left, const LtrContribution& right) {
  return std::tie(left.stamp_ns, left.place) < std::tie(right.stamp_ns, right.place);
}

LogOdds8 ClampToLtr(int log_odds) {
  return static_cast<LogOdds8>(std::clamp(log_odds, -kLtrLogOddsMax, kLtrLogOddsMax));
}

// Readers fetch cells in words of four: room for whole words is allocated, though not used.
std::vector<LogOdds8> CellsWithWholeWords(std::size_t count) {
  std::vector<LogOdds8> cells;
  cells.reserve(count + 3);
  cells.assign(count, kUnobserved);
  return cells;
}

void MakeCoarse(LtrTexture& texture) {
  constexpr std::int32_t kSide = LtrTexture::kCoarseSide;
  texture.coarse_column_count = (texture.column_count + kSide - 1) / kSide;
  texture.coarse_row_count = (texture.row_count + kSide - 1) / kSide;
  texture.coarse_cells = CellsWithWholeWords(static_cast<std::size_t>(texture.coarse_column_count) *
                                             static_cast<std::size_t>(texture.coarse_row_count));
  for (std::int32_t row = 0; row < texture.row_count; ++row) {
    const LogOdds8* from =
        texture.cells.data() + static_cast<std::ptrdiff_t>(row) * texture.column_count;
    LogOdds8* to = texture.coarse_cells.data() +
                   static_cast<std::ptrdiff_t>(row / kSide) * texture.coarse_column_count;
    for (std::int32_t column = 0; column < texture.column_count; ++column) {
      to[column / kSide] = std::max(to[column / kSide], from[column]);  // kUnobserved is the lowest
    }
  }
}

}  // namespace

LtrLayout::LtrLayout(std::int32_t column_count, std::int32_t row_count)
    : column_count_(column_count), row_count_(row_count) {
  LOCI_CHECK(column_count >= 1 && column_count <= kSideCellCountMax);
  LOCI_CHECK(row_count >= 1 && row_count <= kSideCellCountMax);
  row_starts_.reserve(static_cast<std::size_t>(row_count) + 1);
  row_starts_.push_back(0);
  for (std::int32_t row = 0; row < row_count; ++row) {
    // Cell (column, row) touches the simplex if column / columns + row / rows < 1.
    const std::int32_t touching = (column_count * (row_count - row) + row_count - 1) / row_count;
    row_starts_.push_back(row_starts_.back() +
                          static_cast<std::uint32_t>(std::min(column_count, touching + 1)));
  }
}

LtrContribution* LtrLayer::Find(PlaceId place) {
  const auto found =
      std::find_if(contributions_.begin(), contributions_.end(), [&](const LtrContribution& other) {
        return other.place == place;
      });
  return found == contributions_.end() ? nullptr : &*found;
}

void LtrLayer::Add(LtrContribution contribution) {
  LOCI_CHECK(contribution.cells.size() == cell_count_);
  LOCI_CHECK(Find(contribution.place) == nullptr);
  texture_ = nullptr;
  contributions_.insert(
      std::upper_bound(contributions_.begin(), contributions_.end(), contribution, ObservedBefore),
      std::move(contribution));
  if (contributions_.size() > kContributionCountMax) {
    Fold(std::move(contributions_.front()));
    contributions_.erase(contributions_.begin());
  }
}

void LtrLayer::Merge(LtrContribution contribution) {
  LtrContribution* known = Find(contribution.place);
  if (known == nullptr) {
    Add(std::move(contribution));
    return;
  }
  LOCI_CHECK(contribution.cells.size() == cell_count_);
  texture_ = nullptr;
  for (std::size_t i = 0; i < cell_count_; ++i) {
    if (known->cells[i] == kUnobserved) {
      known->cells[i] = contribution.cells[i];
    }
  }
}

void LtrLayer::MergeBase(LtrContribution base) {
  LOCI_CHECK(base.cells.size() == cell_count_);
  texture_ = nullptr;
  Fold(std::move(base));
}

void LtrLayer::Fold(LtrContribution contribution) {
  if (!base_.has_value()) {
    for (LogOdds8& cell : contribution.cells) {
      cell = cell == kUnobserved ? kUnobserved : ClampToLtr(cell);
    }
    base_ = std::move(contribution);
    return;
  }
  for (std::size_t i = 0; i < cell_count_; ++i) {
    const LogOdds8 before = base_->cells[i];
    const LogOdds8 more = contribution.cells[i];
    if (more != kUnobserved) {
      base_->cells[i] = ClampToLtr(before == kUnobserved ? more : before + more);
    }
  }
  if (ObservedBefore(*base_, contribution)) {
    contribution.cells = std::move(base_->cells);
    base_ = std::move(contribution);
  }
}

bool LtrLayer::Remove(PlaceId place) {
  const LtrContribution* found = Find(place);
  if (found == nullptr) {
    return false;
  }
  texture_ = nullptr;
  contributions_.erase(contributions_.begin() + (found - contributions_.data()));
  return true;
}

bool LtrLayer::IsSound() const {
  const auto is_clamped = [](LogOdds8 cell) {
    return cell == kUnobserved || (cell >= -kLtrLogOddsMax && cell <= kLtrLogOddsMax);
  };
  if (base_.has_value() && !std::all_of(base_->cells.begin(), base_->cells.end(), is_clamped)) {
    return false;
  }
  for (std::size_t i = 0; i < contributions_.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (contributions_[j].place == contributions_[i].place ||
          !ObservedBefore(contributions_[j], contributions_[i])) {
        return false;
      }
    }
  }
  return true;
}

std::shared_ptr<const LtrTexture> LtrLayer::Texture(const LtrLayout& layout) const {
  if (texture_ != nullptr) {
    return texture_;
  }
  LOCI_CHECK(layout.cell_count() == cell_count_);
  std::vector<std::int16_t> sum(cell_count_, 0);
  std::vector<std::uint8_t> observed(cell_count_, 0);
  const auto add = [&](const LtrContribution& contribution) {
    for (std::size_t i = 0; i < cell_count_; ++i) {
      const LogOdds8 cell = contribution.cells[i];
      const bool seen = cell != kUnobserved;
      sum[i] = static_cast<std::int16_t>(sum[i] + (seen ? cell : 0));
      observed[i] = static_cast<std::uint8_t>(observed[i] | (seen ? 1 : 0));
    }
  };
  if (base_.has_value()) {
    add(*base_);
  }
  for (const LtrContribution& contribution : contributions_) {
    add(contribution);
  }
  auto texture = std::make_shared<LtrTexture>();
  texture->column_count = layout.column_count();
  texture->row_count = layout.row_count();
  texture->cells = CellsWithWholeWords(static_cast<std::size_t>(layout.column_count()) *
                                       static_cast<std::size_t>(layout.row_count()));
  for (std::int32_t row = 0; row < layout.row_count(); ++row) {
    LogOdds8* to = texture->cells.data() + static_cast<std::ptrdiff_t>(row) * layout.column_count();
    for (std::size_t i = layout.RowStart(row); i < layout.RowStart(row + 1); ++i, ++to) {
      *to = observed[i] != 0 ? ClampToLtr(sum[i]) : kUnobserved;
    }
  }
  MakeCoarse(*texture);
  texture_ = std::move(texture);
  return texture_;
}

}  // namespace loci
