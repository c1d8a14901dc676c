// SPDX-License-Identifier: Apache-2.0
// A made-up building, places that observed it, and the plain way to read a mesh at a point.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/se2.h"
#include "core/grid/log_odds_grid.h"
#include "core/layer/layer.h"
#include "core/mesh/barycentric.h"
#include "core/mesh/mesh_snapshot.h"

namespace loci::testing {

// Walls 0.2 m thick on a lattice of rooms of 5 m with doors of 1 m, free space between.
inline LogOdds8 BuildingAt(const Eigen::Vector2d& point) {
  const auto offset = [](double x) { return x - std::floor(x / 5.0) * 5.0; };
  const double x = offset(point.x());
  const double y = offset(point.y());
  const bool wall_x = x < 0.2 && !(y > 2.0 && y < 3.0);
  const bool wall_y = y < 0.2 && !(x > 2.0 && x < 3.0);
  return wall_x || wall_y ? LogOdds8{40} : LogOdds8{-20};
}

// What a place at `world_from_place` sees of the building: a disc.
inline LogOddsGrid ObserveBuilding(const Pose2& world_from_place,
                                   double radius_m,
                                   double cell_size_m) {
  LogOddsGrid grid;
  const auto cells = static_cast<std::int32_t>(std::ceil(radius_m / cell_size_m));
  const Transformer2 to_world(world_from_place);
  for (std::int32_t y = -cells; y < cells; ++y) {
    for (std::int32_t x = -cells; x < cells; ++x) {
      const Eigen::Vector2d centre((x + 0.5) * cell_size_m, (y + 0.5) * cell_size_m);
      if (centre.norm() < radius_m) {
        grid.Writable({x, y}) = BuildingAt(to_world * centre);
      }
    }
  }
  return grid;
}

// The value of a texture at (u, v), nearest cell.
inline LogOdds8 SampleTexture(const LtrTexture& texture, double u, double v) {
  const auto cell = [](double x, std::int32_t count) {
    return std::clamp(static_cast<std::int32_t>(std::floor(x * count)), 0, count - 1);
  };
  return texture.cells[static_cast<std::size_t>(cell(v, texture.row_count)) *
                           static_cast<std::size_t>(texture.column_count) +
                       static_cast<std::size_t>(cell(u, texture.column_count))];
}

// The sum over all LTRs at a point, clamped; kUnobserved where none has a value.
// (Off by less than a micrometre, so that no point lies on the edge between two triangles.)
inline LogOdds8 SampleMesh(const MeshSnapshot& mesh,
                           Layer layer,
                           const Eigen::Vector2d& exact_point) {
  const Eigen::Vector2d point = exact_point + Eigen::Vector2d(3.7e-7, 1.9e-7);
  int sum = 0;
  bool observed = false;
  for (const LtrSnapshot& ltr : mesh.ltrs) {
    const LtrTexture* texture = layer == Layer::kOccupancy ? ltr.occupancy.get() : ltr.moving.get();
    const TriangleInMap triangle{{mesh.vertices_in_map[ltr.vertices[0].value],
                                  mesh.vertices_in_map[ltr.vertices[1].value],
                                  mesh.vertices_in_map[ltr.vertices[2].value]}};
    const Affine2 map_from_uv = MapFromUv(triangle);
    if (texture == nullptr || map_from_uv.Determinant() < 2e-9) {  // turned over, or a line
      continue;
    }
    const Eigen::Vector2d uv = Inverse(map_from_uv) * point;
    if (uv.x() < 0.0 || uv.y() < 0.0 || uv.x() + uv.y() >= 1.0) {
      continue;
    }
    const LogOdds8 value = SampleTexture(*texture, uv.x(), uv.y());
    if (value != kUnobserved) {
      sum += value;
      observed = true;
    }
  }
  return observed ? static_cast<LogOdds8>(std::clamp(sum, -kLtrLogOddsMax, kLtrLogOddsMax))
                  : kUnobserved;
}

}  // namespace loci::testing
