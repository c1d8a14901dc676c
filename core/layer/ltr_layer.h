// SPDX-License-Identifier: Apache-2.0
// One layer of one LTR: what each place has contributed, and what became of the oldest of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/base/archive.h"
#include "core/base/ids.h"
#include "core/grid/log_odds_grid.h"
#include "core/layer/ltr_texture.h"

namespace loci {

// How the cells of an LTR lie in memory: only those that touch the triangle and one more in each
// row, row after row. (A full rectangle would be half empty.)
class LtrLayout {
 public:
  // Limit of columns and rows: 100 m at the usual cell size of 0.05 m.
  static constexpr std::int32_t kSideCellCountMax = 2048;

  // Both from 1 to kSideCellCountMax.
  LtrLayout(std::int32_t column_count, std::int32_t row_count);

  std::int32_t column_count() const { return column_count_; }
  std::int32_t row_count() const { return row_count_; }
  std::size_t cell_count() const { return row_starts_.back(); }
  // Index of the first cell of a row; the row's cells follow it.
  std::size_t RowStart(std::int32_t row) const {
    return row_starts_[static_cast<std::size_t>(row)];
  }
  std::int32_t RowSize(std::int32_t row) const {
    return static_cast<std::int32_t>(RowStart(row + 1) - RowStart(row));
  }

 private:
  std::int32_t column_count_;
  std::int32_t row_count_;
  std::vector<std::uint32_t> row_starts_;  // row_count + 1
};

// The values that one place has for the cells of an LTR.
struct LtrContribution {
  PlaceId place;
  SessionId session;
  std::int64_t stamp_ns = 0;  // of the place's last observation
  // Where the LTR's corners were in the frame of the place when this was written, in metres: by it
  // the values find their way if the triangle is lost.
  std::array<Eigen::Vector2d, 3> corners_in_place;
  std::vector<LogOdds8> cells;  // by LtrLayout; kUnobserved: the place did not see it
};

// A base and at most kContributionCountMax contributions, served as clamp(base + sum) at
// +-kLtrLogOddsMax. Beyond that number the contribution that was *observed* first is folded into
// the base, so that a late upload of an old view never outlives a newer one.
//
// Law: adding a contribution and removing it gives the state without it, as long as nothing was
// folded in between.
class LtrLayer {
 public:
  static constexpr std::size_t kContributionCountMax = 8;

  explicit LtrLayer(std::size_t cell_count) : cell_count_(cell_count) {}

  // The place must not have contributed yet. The number of cells must be the layer's.
  void Add(LtrContribution contribution);
  // Like Add, but where the place has contributed, only cells that it did not see there are filled.
  void Merge(LtrContribution contribution);
  // Adds what was folded elsewhere.
  void MergeBase(LtrContribution base);
  // False if the place has no contribution here (it never had, or it was folded).
  bool Remove(PlaceId place);

  bool empty() const { return !base_.has_value() && contributions_.empty(); }
  const std::optional<LtrContribution>& base() const { return base_; }
  // In order of (stamp, place).
  const std::vector<LtrContribution>& contributions() const { return contributions_; }
  std::size_t cell_count() const { return cell_count_; }

  // What the layer shows. Made once after a change, then shared.
  std::shared_ptr<const LtrTexture> Texture(const LtrLayout& layout) const;

  // Reads, writes or hashes the state. On reading, `cell_count` of the layer says how much to
  // expect; what cannot be makes the archive fail.
  template <typename Archive>
  void VisitFields(Archive& archive);

 private:
  LtrContribution* Find(PlaceId place);
  void Fold(LtrContribution contribution);
  // The base is within its clamp; contributions are in order and of different places.
  bool IsSound() const;

  std::size_t cell_count_;
  std::optional<LtrContribution> base_;  // of the place folded last, by time of observation
  std::vector<LtrContribution> contributions_;
  mutable std::shared_ptr<const LtrTexture> texture_;  // cache, not state
};

// Cells as runs: how many are unobserved, how many follow that are not, and those.
template <typename Archive>
void VisitCells(Archive& archive, std::vector<LogOdds8>& cells, std::size_t cell_count) {
  if constexpr (Archive::kReads) {
    cells.assign(cell_count, kUnobserved);
  }
  constexpr std::size_t kRunMax = 0xFFFF;
  std::size_t at = 0;
  while (at < cell_count) {
    std::uint16_t skipped = 0;
    std::uint16_t count = 0;
    if constexpr (!Archive::kReads) {
      std::size_t end = at;
      while (end < cell_count && end - at < kRunMax && cells[end] == kUnobserved) {
        ++end;
      }
      skipped = static_cast<std::uint16_t>(end - at);
      const std::size_t begin = end;
      while (end < cell_count && end - begin < kRunMax && cells[end] != kUnobserved) {
        ++end;
      }
      count = static_cast<std::uint16_t>(end - begin);
    }
    archive(skipped, count);
    if constexpr (Archive::kReads) {
      const std::size_t run = std::size_t{skipped} + count;
      if (run == 0 || run > cell_count - at) {
        archive.Fail();
        return;
      }
    }
    archive.Raw(cells.data() + at + skipped, count);
    at += std::size_t{skipped} + count;
  }
}

template <typename Archive>
void VisitContribution(Archive& archive, LtrContribution& contribution, std::size_t cell_count) {
  archive(contribution.place, contribution.session, contribution.stamp_ns);
  for (Eigen::Vector2d& corner : contribution.corners_in_place) {
    archive(corner.x(), corner.y());
    if constexpr (Archive::kReads) {
      if (!(corner.cwiseAbs().maxCoeff() < 1e9)) {
        archive.Fail();
      }
    }
  }
  VisitCells(archive, contribution.cells, cell_count);
}

template <typename Archive>
void LtrLayer::VisitFields(Archive& archive) {
  std::uint8_t has_base = base_.has_value() ? 1 : 0;
  auto count = static_cast<std::uint8_t>(contributions_.size());
  archive(has_base, count);
  if constexpr (Archive::kReads) {
    texture_ = nullptr;
    if (has_base > 1 || count > kContributionCountMax) {
      archive.Fail();
      return;
    }
    base_.reset();
    if (has_base == 1) {
      base_.emplace();
    }
    contributions_.assign(count, LtrContribution());
  }
  if (base_.has_value()) {
    VisitContribution(archive, *base_, cell_count_);
  }
  for (LtrContribution& contribution : contributions_) {
    VisitContribution(archive, contribution, cell_count_);
  }
  if constexpr (Archive::kReads) {
    if (!IsSound()) {
      archive.Fail();
    }
  }
}

}  // namespace loci
