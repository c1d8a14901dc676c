// SPDX-License-Identifier: Apache-2.0
// Gradient descent on a tree parameterisation of a pose graph in space.
//
// After G. Grisetti, C. Stachniss, W. Burgard: "Nonlinear Constraint Network Optimization for
// Efficient Map Learning" (T-ITS 2009), which distributes a rotation over a path by slerp.
//
// As in the plane (toro_patch.h) a residual is spread over the path between a constraint's nodes in
// proportion to their compliance, rotations first, then offsets at fixed rotations. Rotations do
// not commute, so that the residual of a rotation is no sum over the path. Let A and B be the
// rotations of `from` and `to` in the frame of the path's top, and Z the measured one: E = A Z B^T
// is what B must be turned by, in the top's frame. With E^u the rotation about the same axis by the
// part u of its angle (slerp from the identity to E), turning A by E^-a and B by E^b with
// a + b = 1 meets the constraint:
//   (E^-a A)^T (E^b B) = A^T E B = Z.
// All E^u share their axis. So a node of the half of `to`, whose parent was at G in the top's
// frame, takes its share b_k of the angle by
//   R_k <- (G^T E^b_k G) R_k,
// whatever the shares of those above it are: their product turns the node by E^(b_1 + .. + b_k) in
// the top's frame. The half of `from` does the same with the opposite sign.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/geometry/se3.h"
#include "core/graph/space_graph.h"
#include "core/graph/toro_paths.h"
#include "core/graph/toro_tree.h"

namespace loci {

// Batch sweeps with one learning rate for all constraints: 1, 1/2, 1/3 .. Deterministic; no
// allocation in a sweep. Robust, not exact: finish with OptimizeSparse.
//
// Begin at the better of the given poses and PlaceByTree's: of the errors of raw odometry, which no
// constraint of the tree meets, sweeps take little (parking-garage after 50: 3300 from its
// file, 1.6 from the tree, 1.24 at the optimum).
//
// Fixed nodes keep their poses, and so does the lowest node of a component without one. Point
// constraints and priors take no part.
class SpaceToroOptimizer {
 public:
  // Starts at the graph's poses. The graph must be valid and sweepable (sweep_limit.h).
  explicit SpaceToroOptimizer(const SpaceGraph& graph);

  void Sweep();

  // Poses of all nodes, composed from the roots.
  std::vector<Pose3> Poses() const;

 private:
  struct Constraint {
    std::uint32_t from = 0;
    Pose3 from_from_to;
  };

  void AddNodes(const SpaceGraph& graph, const ToroTree& tree);
  void AddConstraints(const SpaceGraph& graph, const ToroTree& tree);
  Eigen::Quaterniond RotationAtTop(std::span<const std::uint32_t> half) const;
  void SpreadRotation(std::size_t constraint);
  void TurnHalf(std::span<const std::uint32_t> half,
                const Eigen::Vector3d& axis_at_top,
                double rad_per_compliance);
  void TurnSubtrees();

  // Nodes in tree order: every parent comes before its children.
  std::vector<std::uint32_t> node_of_index_;
  std::vector<std::uint32_t> parent_;                 // kNone for roots
  std::vector<Eigen::Quaterniond> parent_from_node_;  // of roots, map_from_node
  std::vector<Eigen::Vector3d> offset_;               // from the parent, in the map's frame
  std::vector<Eigen::Quaterniond> map_from_node_;     // as of the last TurnSubtrees
  std::vector<Eigen::Quaterniond> turn_;              // by the last TurnSubtrees, in the map

  std::vector<Constraint> constraints_;  // those nearest to the root first
  ToroPaths paths_;
  double rate_ = 1.0;
  std::vector<double> rates_;  // rate_ for every constraint
};

}  // namespace loci
