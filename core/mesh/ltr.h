// SPDX-License-Identifier: Apache-2.0
// One local triangular region with its layers, and how values get into it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/base/archive.h"
#include "core/base/ids.h"
#include "core/geometry/se2.h"
#include "core/grid/log_odds_grid.h"
#include "core/layer/layer.h"
#include "core/layer/ltr_layer.h"
#include "core/mesh/barycentric.h"

namespace loci {

struct Ltr {
  std::array<VertexId, 3> vertices;  // the first spans the frame of the cells
  LtrLayout layout;
  TriangleShape shape_when_laid_out;
  std::array<LtrLayer, kLayers.size()> layers;  // by Layer; empty where nothing was written

  // For checkpoints, not state: the events that made it and that changed it last.
  EventNumber created;
  EventNumber changed;

  LtrLayer& At(Layer layer) { return layers[static_cast<std::size_t>(layer)]; }
  const LtrLayer& At(Layer layer) const { return layers[static_cast<std::size_t>(layer)]; }
};

// Orders the corners of a triangle, counter-clockwise as they are, so that the angle at the first
// is nearest to 90 degrees: the cells are then as square as they can be.
std::array<VertexId, 3> OrderForCells(const std::array<VertexId, 3>& vertices,
                                      const TriangleInMap& triangle);

// As many cells as it takes for none to be longer than `cell_size_m`, within LtrLayout's limits.
LtrLayout LayOutCells(const TriangleInMap& triangle, double cell_size_m);

// The values of `grid` at the centres of the cells of a triangle, nearest cell.
// `corners_in_place`: in the frame of the grid. Nothing if no cell was observed.
std::optional<std::vector<LogOdds8>> SampleGrid(
    const LogOddsGrid& grid,
    double cell_size_m,
    const LtrLayout& layout,
    const std::array<Eigen::Vector2d, 3>& corners_in_place);

// Which cell of one triangle lies under the centre of each cell of another, at one time.
class CellMap {
 public:
  // Triangles as they lie in the map; the source must have an area.
  CellMap(const LtrLayout& source_layout,
          const TriangleInMap& source,
          const LtrLayout& target_layout,
          const TriangleInMap& target);

  bool empty() const { return empty_; }
  // The source's values at the target's cells, kUnobserved where it does not reach. Nothing if none
  // was observed.
  std::optional<std::vector<LogOdds8>> Resample(const std::vector<LogOdds8>& source_cells) const;

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  std::vector<std::uint32_t> source_of_target_;
  bool empty_ = true;
};

// Points, in the frame of `corners`, that stand for all observed cells: none of these is further
// than a few cells from one of them.
std::vector<Eigen::Vector2d> ObservedPoints(const LtrLayout& layout,
                                            const std::array<Eigen::Vector2d, 3>& corners,
                                            const std::vector<LogOdds8>& cells);

std::size_t CountObserved(const std::vector<LogOdds8>& cells);

std::string EncodeLtr(const Ltr& ltr);
// kDataLoss if the bytes are not those of an LTR whose vertices are below `vertex_count`.
StatusOr<Ltr> DecodeLtr(std::string_view bytes, std::size_t vertex_count);
void AddToHash(HashArchive& archive, const Ltr& ltr);

}  // namespace loci
