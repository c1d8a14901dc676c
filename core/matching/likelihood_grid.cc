// SPDX-License-Identifier: Apache-2.0
#include "core/matching/likelihood_grid.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/base/math.h"

namespace loci {
namespace {

constexpr std::int32_t kKernelSide = 2 * LikelihoodGrid::kReachCells + 1;
constexpr std::size_t kPaddingBytes = 32;  // so that rows can be loaded in whole registers
constexpr std::int32_t kGrowthCells = 128;

}  // namespace

LikelihoodGrid::LikelihoodGrid(CellBox box, double cell_size_m) : cell_size_m_(cell_size_m) {
  MakeKernel();
  Resize(box);
}

LikelihoodGrid LikelihoodGrid::OfPatch(const Patch& patch, std::uint32_t hits_min) {
  CellBox box{{INT32_MAX, INT32_MAX}, {INT32_MIN, INT32_MIN}};
  for (const PatchCell& cell : patch.cells()) {
    if (cell.hits >= hits_min) {
      box.min = {std::min(box.min.x, cell.cell.x), std::min(box.min.y, cell.cell.y)};
      box.max = {std::max(box.max.x, cell.cell.x + 1), std::max(box.max.y, cell.cell.y + 1)};
    }
  }
  if (box.Empty()) {
    return {{{0, 0}, {1, 1}}, patch.cell_size_m()};
  }
  box.min = {box.min.x - kReachCells, box.min.y - kReachCells};
  box.max = {box.max.x + kReachCells, box.max.y + kReachCells};
  LikelihoodGrid grid(box, patch.cell_size_m());
  for (const PatchCell& cell : patch.cells()) {
    if (cell.hits >= hits_min) {
      grid.Add(cell.cell);
    }
  }
  return grid;
}

void LikelihoodGrid::MakeKernel() {
  kernel_.resize(kKernelSide * kKernelSide);
  for (std::int32_t dy = -kReachCells; dy <= kReachCells; ++dy) {
    for (std::int32_t dx = -kReachCells; dx <= kReachCells; ++dx) {
      const double distance_m = cell_size_m_ * std::sqrt(static_cast<double>(dx * dx + dy * dy));
      const double value = 255.0 * Exp(-0.5 * distance_m * distance_m / (kSigmaM * kSigmaM));
      kernel_[static_cast<std::size_t>((dy + kReachCells) * kKernelSide + dx + kReachCells)] =
          static_cast<std::uint8_t>(value + 0.5);
    }
  }
}

void LikelihoodGrid::Resize(CellBox box) {
  const std::int32_t width = box.max.x - box.min.x;
  const std::int32_t height = box.max.y - box.min.y;
  std::vector<std::uint8_t> bytes(
      static_cast<std::size_t>(width) * static_cast<std::size_t>(height) + kPaddingBytes);
  for (std::int32_t y = 0; y < height_; ++y) {
    const std::size_t to =
        static_cast<std::size_t>(y + box_.min.y - box.min.y) * static_cast<std::size_t>(width) +
        static_cast<std::size_t>(box_.min.x - box.min.x);
    std::memcpy(&bytes[to],
                &bytes_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_)],
                static_cast<std::size_t>(width_));
  }
  bytes_ = std::move(bytes);
  box_ = box;
  width_ = width;
  height_ = height;
}

void LikelihoodGrid::Add(CellIndex cell) {
  const CellBox needed{{cell.x - kReachCells, cell.y - kReachCells},
                       {cell.x + kReachCells + 1, cell.y + kReachCells + 1}};
  CellBox grown = box_;
  if (needed.min.x < box_.min.x) {
    grown.min.x = needed.min.x - kGrowthCells;
  }
  if (needed.min.y < box_.min.y) {
    grown.min.y = needed.min.y - kGrowthCells;
  }
  if (needed.max.x > box_.max.x) {
    grown.max.x = needed.max.x + kGrowthCells;
  }
  if (needed.max.y > box_.max.y) {
    grown.max.y = needed.max.y + kGrowthCells;
  }
  if (grown.min != box_.min || grown.max != box_.max) {
    Resize(grown);
  }
  const std::uint8_t* kernel = kernel_.data();
  for (std::int32_t y = needed.min.y; y < needed.max.y; ++y) {
    std::uint8_t* row =
        &bytes_[static_cast<std::size_t>(y - box_.min.y) * static_cast<std::size_t>(width_) +
                static_cast<std::size_t>(needed.min.x - box_.min.x)];
    for (std::int32_t x = 0; x < kKernelSide; ++x) {
      row[x] = std::max(row[x], *kernel++);
    }
  }
}

}  // namespace loci
