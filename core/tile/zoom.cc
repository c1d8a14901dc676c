// SPDX-License-Identifier: Apache-2.0
#include "core/tile/zoom.h"

#include <algorithm>
#include <cmath>

#include "core/base/check.h"

namespace loci {

void BoxInMap::Extend(const Eigen::Vector2d& point_in_map) {
  if (Empty()) {
    min = point_in_map;
    max = point_in_map;
    return;
  }
  min = min.cwiseMin(point_in_map);
  max = max.cwiseMax(point_in_map);
}

void BoxInMap::Extend(const BoxInMap& box) {
  if (!box.Empty()) {
    Extend(box.min);
    Extend(box.max);
  }
}

bool BoxInMap::Intersects(const BoxInMap& box) const {
  return !Empty() && !box.Empty() && min.x() <= box.max.x() && box.min.x() <= max.x() &&
         min.y() <= box.max.y() && box.min.y() <= max.y();
}

bool BoxInMap::Contains(const BoxInMap& box) const {
  return !Empty() && !box.Empty() && min.x() <= box.min.x() && min.y() <= box.min.y() &&
         max.x() >= box.max.x() && max.y() >= box.max.y();
}

Status Validate(const TileAddress& address) {
  const auto out_of_range = [](const char* field, std::int64_t value, const std::string& bounds) {
    return OutOfRangeError(std::string(field) + ": " + std::to_string(value) + ", must be " +
                           bounds);
  };
  if (address.zoom < 0 || address.zoom > kZoomMax) {
    return out_of_range("z", address.zoom, "from 0 to " + std::to_string(kZoomMax));
  }
  const std::string bounds = "between " + std::to_string(-kTileIndexLimit) + " and " +
                             std::to_string(kTileIndexLimit) + ", both excluded";
  if (address.x <= -kTileIndexLimit || address.x >= kTileIndexLimit) {
    return out_of_range("x", address.x, bounds);
  }
  if (address.y <= -kTileIndexLimit || address.y >= kTileIndexLimit) {
    return out_of_range("y", address.y, bounds);
  }
  return {};
}

double TileSideM(int zoom) {
  LOCI_CHECK(zoom >= 0 && zoom <= kZoomMax);
  return kTileSideAtZoom0M / static_cast<double>(1 << zoom);
}

double PixelSideM(int zoom) {
  return TileSideM(zoom) / kTileSide;
}

BoxInMap BoxOf(const TileAddress& address) {
  const double side_m = TileSideM(address.zoom);
  BoxInMap box;
  box.min = Eigen::Vector2d(address.x, address.y) * side_m;
  box.max = Eigen::Vector2d(address.x + 1, address.y + 1) * side_m;
  return box;
}

std::vector<TileAddress> TilesUnder(const BoxInMap& box, int zoom) {
  std::vector<TileAddress> tiles;
  if (box.Empty()) {
    return tiles;
  }
  const double side_m = TileSideM(zoom);
  const auto index_of = [&](double metres) {
    const double limit = kTileIndexLimit - 1;
    return static_cast<std::int32_t>(std::clamp(std::floor(metres / side_m), -limit, limit));
  };
  for (std::int32_t y = index_of(box.min.y()); y <= index_of(box.max.y()); ++y) {
    for (std::int32_t x = index_of(box.min.x()); x <= index_of(box.max.x()); ++x) {
      tiles.push_back({zoom, x, y});
    }
  }
  return tiles;
}

}  // namespace loci
