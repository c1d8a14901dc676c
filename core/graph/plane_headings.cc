// SPDX-License-Identifier: Apache-2.0
// Headings that agree, as a linear problem with one number per node, and positions that follow.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/graph/plane_problem.h"

namespace loci {
namespace {

using Vector1 = Eigen::Matrix<double, 1, 1>;

// The information about the turn alone, as the kernel has it.
template <typename Constraint>
double WeightOfTurn(const Constraint& constraint, double error_rad, const RobustKernel& kernel) {
  const double information = constraint.information(2, 2);
  return constraint.robust ? kernel.Weight(information * error_rad * error_rad) * information
                           : information;
}

}  // namespace

// e = theta_b - theta_a - theta_z, wrapped at the present headings, with the information about the
// turn alone.
void PlaneProblem::LineariseHeadings(NormalEquations& headings) const {
  std::size_t pair = 0;
  for (std::size_t i = 0; i < graph_->constraints.size(); ++i) {
    const GraphConstraint& constraint = graph_->constraints[i];
    const std::uint32_t a = block_of_node_[constraint.from];
    const std::uint32_t b = block_of_node_[constraint.to];
    LinearisedPair<1, 1, 1> linearised;
    linearised.error(0) = WrapAngle(nodes_[constraint.to].theta - nodes_[constraint.from].theta -
                                    measurements_[i].theta);
    linearised.jacobian_a(0) = -1.0;
    linearised.jacobian_b(0) = 1.0;
    const Vector1 weight(WeightOfTurn(constraint, linearised.error(0), kernel_));
    AddPair(linearised, weight, a, b, pair, headings);
    pair += a != kHeldBlock && b != kHeldBlock ? 1 : 0;
  }
  for (const PosePrior& prior : graph_->pose_priors) {
    const Vector1 error(WrapAngle(nodes_[prior.node].theta - prior.map_from_node.theta));
    AddSingle<1, 1>(error,
                    Vector1(1.0),
                    Vector1(WeightOfTurn(prior, error(0), kernel_)),
                    block_of_node_[prior.node],
                    headings);
  }
  for (const GaugeTie<3>& tie : gauge_ties_) {
    headings.AddDiagonal<1>(block_of_node_[tie.node], Vector1(tie.information(2, 2)));
  }
}

// Positions in the map tie a component's heading, too, but not in equations that have none.
bool PlaneProblem::HeadingsAreTied() const {
  if (graph_->pose_priors.empty() && graph_->position_priors.empty()) {
    return true;  // a node of every component is held (FindGauge)
  }
  const GraphComponents components = FindComponents(*graph_);
  std::vector<bool> tied(components.count);
  for (std::size_t i = 0; i < block_of_node_.size(); ++i) {
    if (block_of_node_[i] == kHeldBlock) {
      tied[components.of_node[i]] = true;
    }
  }
  for (const PosePrior& prior : graph_->pose_priors) {
    if (prior.information(2, 2) > 0.0) {
      tied[components.of_node[prior.node]] = true;
    }
  }
  for (const GaugeTie<3>& tie : gauge_ties_) {
    if (tie.information(2, 2) > 0.0) {
      tied[components.of_node[tie.node]] = true;
    }
  }
  return std::all_of(components.of_node.begin(),
                     components.of_node.end(),
                     [&](std::uint32_t component) { return tied[component]; });
}

bool PlaneProblem::TurnToAgree(NormalEquations& equations) {
  if (!graph_->point_constraints.empty() || !graph_->joint_constraints.empty() ||
      equations.size() == 0 || !HeadingsAreTied()) {
    return false;
  }
  NormalEquations headings = equations.Resized(1);
  LineariseHeadings(headings);
  if (!headings.Factor(0.0)) {
    return false;
  }
  const Eigen::VectorXd turns = headings.Step();
  for (std::size_t i = 0; i < block_of_node_.size(); ++i) {
    if (block_of_node_[i] != kHeldBlock) {
      Pose2& node = graph_->map_from_node[i];
      node.theta = WrapAngle(node.theta + turns(headings.offset(block_of_node_[i])));
      nodes_[i] = TurnedPose2(node);
    }
  }
  return true;
}

bool PlaneProblem::PlaceToAgree(NormalEquations& equations) {
  equations.Clear();
  Linearise(Levers::kMeasured, equations);
  if (!equations.Factor(0.0)) {
    return false;
  }
  Move(equations.Step(), equations);
  return true;
}

}  // namespace loci
