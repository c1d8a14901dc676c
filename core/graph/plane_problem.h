// SPDX-License-Identifier: Apache-2.0
// A pose graph in the plane as a least squares problem: its linearisation and its moves.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/se2.h"
#include "core/graph/gauge.h"
#include "core/graph/least_squares.h"
#include "core/graph/linearised_prior.h"
#include "core/graph/pose_graph.h"
#include "core/graph/robust_kernel.h"

namespace loci {

// Error and Jacobians of a constraint for right perturbations of its nodes, map_from_node *
// Exp(xi), and for a shift of the point in the map.
LinearisedPair<3, 3, 3> Linearised(const PoseGraph& graph, const GraphConstraint& constraint);
LinearisedPair<2, 3, 2> Linearised(const PoseGraph& graph, const PointConstraint& constraint);
LinearisedPrior<3, 3> Linearised(const PoseGraph& graph, const PosePrior& prior);
LinearisedPrior<2, 3> Linearised(const PoseGraph& graph, const PositionPrior& prior);

// WriteTerm of a constraint between two free poses in the plane, with the same bits, sparing what
// is zero or one in all their Jacobians.
void WritePoseTerm(const LinearisedPair<3, 3, 3>& linearised,
                   const Eigen::Matrix3d& weight,
                   double* values);

// A pose with its sine and cosine, which are dear.
struct TurnedPose2 {
  explicit TurnedPose2(const Pose2& pose) : x(pose.x), y(pose.y), theta(pose.theta) {
    const SineAndCosine turn = SinCos(theta);
    sine = turn.sine;
    cosine = turn.cosine;
  }

  double x;
  double y;
  double theta;
  double sine;
  double cosine;
};

// Blocks: free nodes in the order of their index, then free points that have a constraint. Refers
// to a graph that lives longer and keeps its constraints.
class PlaneProblem final : public LeastSquaresProblem {
 public:
  PlaneProblem(PoseGraph& graph, const RobustKernel& kernel);

  std::vector<int> BlockSizes() const override { return block_sizes_; }
  std::vector<BlockPair> Pairs() const override;
  std::vector<BlockGroup> Groups() const override;
  double Cost() const override;
  void Linearise(NormalEquations& equations) const override;
  void Move(const Eigen::VectorXd& step, const NormalEquations& equations) override;
  void Mark() override;
  void MoveBack() override;

  struct State {
    std::vector<Pose2> map_from_node;
    std::vector<Eigen::Vector2d> points_in_map;
  };
  State Save() const { return {graph_->map_from_node, graph_->points_in_map}; }
  void Restore(const State& state);

  // Turns the free nodes, and moves nothing, to the headings that agree best with the constraints'
  // and priors': a linear problem, once it is said how often each loop turns round, which is taken
  // from the present headings (Carlone, Aragues, Castellanos and Bona, "A linear approximation for
  // graph-based simultaneous localization and mapping", RSS 2011, their first phase). `equations`
  // are those of this problem. False, and nothing is turned, if something is not determined that
  // way, or if the graph has points or joint constraints, which say something about headings too.
  bool TurnToAgree(NormalEquations& equations);
  // After TurnToAgree: moves the free nodes, and turns them a little more, to where they agree best
  // with everything if the headings are right but for small angles. That is a linear problem
  // wherever the nodes are (second phase of the same paper): the step of Gauss and Newton, but each
  // heading turns the offset to the next node as it was measured, not as the two now stand. False,
  // and nothing moves, if that does not determine all of them.
  bool PlaceToAgree(NormalEquations& equations);

  // kHeldBlock for held nodes.
  std::uint32_t BlockOfNode(std::uint32_t node) const { return block_of_node_[node]; }

 private:
  // What turns with a node, in the derivative of a constraint's error by its heading.
  enum class Levers : std::uint8_t { kPredicted, kMeasured };

  void Linearise(Levers levers, NormalEquations& equations) const;
  void LinearisePriors(NormalEquations& equations) const;
  bool HeadingsAreTied() const;
  void LineariseHeadings(NormalEquations& headings) const;
  void LineariseJoints(NormalEquations& equations) const;
  double Rho(double chi2, bool robust) const { return robust ? kernel_.Rho(chi2) : chi2; }

  PoseGraph* graph_;
  RobustKernel kernel_;
  std::vector<GaugeTie<3>> gauge_ties_;
  std::vector<int> block_sizes_;
  std::vector<std::uint32_t> block_of_node_;
  std::vector<std::uint32_t> block_of_point_;
  std::vector<TurnedPose2> nodes_;         // where they are now
  std::vector<TurnedPose2> measurements_;  // of the constraints
  std::vector<TurnedPose2> turned_before_;
  std::vector<Pose2> nodes_before_;
  std::vector<Eigen::Vector2d> points_before_;
};

// Of the graph as it stands.
inline double CostOf(PoseGraph& graph, const RobustKernel& kernel) {
  return PlaneProblem(graph, kernel).Cost();
}

}  // namespace loci
