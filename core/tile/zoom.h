// SPDX-License-Identifier: Apache-2.0
// Addresses of tiles: which square of the map a tile shows (design.md, section 6).
#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/status.h"

namespace loci {

inline constexpr std::int32_t kTileSide = 256;             // pixels
inline constexpr double kTileSideAtZoom0M = 256.0 * 12.8;  // metres; every level halves it
inline constexpr int kZoomMax = 24;
inline constexpr std::int32_t kTileIndexLimit = 1 << 24;  // |x|, |y| lie below

// Zoom of the dirty tiles that watchers are told: 12.8 m to a side, less than the reach of a scan.
inline constexpr int kDirtyTileZoom = 8;

// Tile (0, 0) has its lower left corner at the map's origin; x grows right, y grows up.
struct TileAddress {
  int zoom = 0;
  std::int32_t x = 0;
  std::int32_t y = 0;

  // clang-tidy 14 takes what the compiler makes of <=> for a null pointer.
  friend auto operator<=>(const TileAddress&,
                          const TileAddress&) = default;  // NOLINT(modernize-use-nullptr)
};

// An axis-parallel box in frame map, in metres; closed. Empty if max < min in either direction.
struct BoxInMap {
  Eigen::Vector2d min = Eigen::Vector2d(1.0, 1.0);
  Eigen::Vector2d max = Eigen::Vector2d(-1.0, -1.0);

  bool Empty() const { return max.x() < min.x() || max.y() < min.y(); }
  void Extend(const Eigen::Vector2d& point_in_map);
  void Extend(const BoxInMap& box);
  bool Intersects(const BoxInMap& box) const;
  bool Contains(const BoxInMap& box) const;
};

// kOutOfRange names the index that is out of its bounds.
Status Validate(const TileAddress& address);

double TileSideM(int zoom);
double PixelSideM(int zoom);
BoxInMap BoxOf(const TileAddress& address);

// Tiles that share area or border with `box`, ordered by (y, x); none for an empty box. Indices
// beyond kTileIndexLimit are left out.
std::vector<TileAddress> TilesUnder(const BoxInMap& box, int zoom);

}  // namespace loci
