// SPDX-License-Identifier: Apache-2.0
// The mesh as readers see it: where its vertices are now, and the textures of its triangles.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "core/base/ids.h"
#include "core/layer/ltr_texture.h"

namespace loci {

struct LtrSnapshot {
  std::array<VertexId, 3> vertices;             // counter-clockwise when it is served
  std::shared_ptr<const LtrTexture> occupancy;  // never null
  std::shared_ptr<const LtrTexture> moving;     // null if nothing moved here
};

struct MeshSnapshot {
  std::vector<Eigen::Vector2d> vertices_in_map;  // by VertexId
  std::vector<LtrSnapshot> ltrs;                 // in a fixed order; those turned over are left out
};

}  // namespace loci
