// SPDX-License-Identifier: Apache-2.0
// The part of a pose graph that gradient descent works on, as contiguous arrays in tree order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/se2.h"
#include "core/graph/toro_forest.h"
#include "core/graph/toro_paths.h"

namespace loci {

// What is minimised. Let node k hang below p(k), turned against it by theta_k and, in the map's
// frame, away from it by d_k. A constraint z with the path P has the residuals
//   turn:   r = theta_z + sum of theta_k on the half of `from` - the same on the half of `to`,
//   offset: r = R(heading of from) t_z + sum of d_k on the half of `from` - the same of `to`.
// Both are sums over the path, so that a node on it turns or shifts the residual by as much as
// itself: the Jacobian of 2007 for the tree parameterisation. Offsets are taken at fixed headings,
// and headings do without the offsets: two linear problems, one after the other, whose solution is
// near the optimum (chi2 1.2 times as high on manhattanOlson3500), and from which Gauss-Newton goes
// on. When a node turns, all below it is carried along (T-ITS 2009, where the rotation is spread
// first and the translation then; here that is so for the sweep as a whole, which leaves one sine
// and cosine per node and sweep in place of one per path element).
//
// Two ways to go down, both in fixed order:
// - Sweep: constraint by constraint, its residual is spread over its path (RSS 2007). Closes long
//   loops at once, and leaves behind what the last constraints said too loudly. Allocates nothing.
// - Settle: node by node, each goes where the constraints through it agree best while all other
//   nodes keep their parameters: exact minimisation by one coordinate, so that nothing gets worse.
//   Too slow for a long loop, but ends in the minimum and needs no learning rate.
class ToroPatch {
 public:
  static constexpr std::uint32_t kNone = ToroTree::kNone;

  void Clear();

  // Nodes get the indices 0, 1, 2 .. and come after their parents (kNone: parent_from_node is
  // map_from_node). A node without stiffness does not move.
  std::uint32_t AddNode(std::uint32_t parent, const Pose2& parent_from_node);
  void SetStiffness(std::uint32_t node, const ToroWeights& stiffness) {
    paths_.SetStiffness(node, stiffness);
  }

  // After its nodes and their stiffness. `from` and `path` in indices of the patch; `label` is the
  // caller's.
  void AddConstraint(const ToroForest::Edge& edge,
                     std::uint32_t from,
                     const ToroPath& path,
                     std::uint32_t label);

  std::size_t node_count() const { return theta_.size(); }
  std::size_t constraint_count() const { return constraints_.size(); }
  std::uint32_t label(std::size_t constraint) const { return constraints_[constraint].label; }
  // Whether the node has a stiffness: all others keep their bits.
  bool Moves(std::uint32_t node) const { return paths_.Moves(node); }
  Pose2 ParentFromNode(std::uint32_t node) const;

  // Spreads every constraint over its path, with rates[i] for constraint i; a rate of 0 leaves the
  // constraint out.
  void Sweep(std::span<const double> rates);

  struct SettleOptions {
    // Passes over the nodes, for turns and for offsets; what is not at rest then is `disturbed`.
    int passes_max = 10;
    // A node moves if that lowers the sum of squares by more than this. No unit: chi2. On
    // manhattanOlson3500 a third of it costs a fifth more time and ends at 1.33 of the optimum in
    // place of 1.40; three times as much saves a third of the time and ends at 1.56.
    double gain_min = 3e-3;
  };
  // Moves `nodes`, in this order, whose constraints must all be in the patch and be what the
  // stiffness was summed from. Appends to `disturbed` the other nodes of the patch whose
  // constraints changed so much that moving them would gain more than gain_min, and those of
  // `nodes` that had not come to rest; without duplicates.
  void Settle(std::span<const std::uint32_t> nodes,
              const SettleOptions& options,
              std::vector<std::uint32_t>& disturbed);

 private:
  struct Constraint {
    std::uint32_t from = 0;
    std::uint32_t label = 0;
    double turn_rad = 0.0;  // theta_z, plus the full turns that keep its residual in (-pi, pi]
    Eigen::Vector2d offset = Eigen::Vector2d::Zero();  // t_z
  };

  void SpreadTurns(std::span<const double> rates);
  void TurnSubtrees();
  double TurnResidual(std::size_t constraint);
  Eigen::Vector2d MeasuredInMap(std::size_t constraint) const;
  void FindOffsetResiduals(std::vector<Eigen::Vector2d>& residuals) const;
  void FindCrossings(std::span<const std::uint32_t> nodes);
  std::span<const std::uint32_t> CrossingsOf(std::size_t place) const;
  bool SettleTurns(std::span<const std::uint32_t> nodes, double gain_min);
  bool SettleOffsets(std::span<const std::uint32_t> nodes, double gain_min);
  void FindDisturbed(double gain_min);

  // By node.
  std::vector<std::uint32_t> parent_;
  std::vector<double> theta_;
  std::vector<Eigen::Vector2d> offset_;  // from the parent, in the map's frame
  // In the map's frame, as of the last TurnSubtrees: offsets lag behind theta_ until then.
  std::vector<double> heading_rad_;
  std::vector<Eigen::Vector2d> direction_;  // (cosine, sine) of the heading
  std::vector<Eigen::Vector2d> turn_;       // (cosine, sine) of the heading's last change

  std::vector<Constraint> constraints_;
  ToroPaths paths_;

  // Of Settle. A crossing is a constraint through a node: twice its index, plus 1 on the half of
  // `from`, where moving the node adds to the residual.
  std::vector<std::uint32_t> crossing_begin_;  // by place in `nodes`, and one more
  std::vector<std::uint32_t> crossings_;
  std::vector<std::uint32_t> place_of_node_;  // kNone for those that do not settle
  std::vector<double> turn_residual_rad_;     // by constraint
  std::vector<Eigen::Vector2d> offset_residual_;
  std::vector<double> turn_before_rad_;
  std::vector<Eigen::Vector2d> offset_before_;
  std::vector<bool> is_disturbed_;
};

}  // namespace loci
