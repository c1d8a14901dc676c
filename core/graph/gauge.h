// SPDX-License-Identifier: Apache-2.0
// What ties the components of a pose graph to the map, and what an optimiser holds where nothing
// does.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/graph/pose_graph.h"
#include "core/graph/space_graph.h"

namespace loci {

// A component's constraints leave a rigid motion of all of it open. Fixed nodes, priors and fixed
// points determine this motion in all directions, in some (one GNSS fix leaves a turn about it), or
// in none.
//
// All: nothing needs to be held. None: the lowest node of the component is held, as if it were
// fixed. Some: the directions left open get a tie. Its information is added to the node's diagonal
// block of the normal equations, and nothing to their gradient: since no error depends on these
// directions, the minimum stays what it is, and the equations determine a step.
template <int kSize>
struct GaugeTie {
  std::uint32_t node = 0;
  Eigen::Matrix<double, kSize, kSize> information =
      Eigen::Matrix<double, kSize, kSize>::Zero();  // for a right perturbation of the node
};

template <int kSize>
struct Gauge {
  std::vector<bool> held;  // as long as the nodes
  std::vector<GaugeTie<kSize>> ties;
};

// The directions are those at the present poses; kernels play no part.
Gauge<3> FindGauge(const PoseGraph& graph);
Gauge<6> FindGauge(const SpaceGraph& graph);

}  // namespace loci
