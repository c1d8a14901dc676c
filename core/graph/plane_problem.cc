// SPDX-License-Identifier: Apache-2.0
// Analytic Jacobians of the constraints in the plane.
#include "core/graph/plane_problem.h"

#include <cstddef>
#include <type_traits>
#include <utility>

#include "core/graph/joint_constraint.h"

namespace loci {
namespace {

// R(theta)^T.
Eigen::Matrix2d InverseRotation(double theta) {
  const double cosine = Cos(theta);
  const double sine = Sin(theta);
  Eigen::Matrix2d matrix;
  matrix << cosine, sine, -sine, cosine;
  return matrix;
}

// d(R(theta) v) / d theta at theta = 0.
Eigen::Vector2d Turned(const Eigen::Vector2d& v) {
  return {-v.y(), v.x()};
}

// e = Z^-1 A^-1 B, with M = A^-1 B the predicted pose of B in A.
struct PoseError {
  PoseError(const TurnedPose2& a, const TurnedPose2& b, const TurnedPose2& z) {
    const double dx = b.x - a.x;
    const double dy = b.y - a.y;
    predicted = {a.cosine * dx + a.sine * dy, a.cosine * dy - a.sine * dx};
    const double ex = predicted.x() - z.x;
    const double ey = predicted.y() - z.y;
    error = {z.cosine * ex + z.sine * ey,
             z.cosine * ey - z.sine * ex,
             WrapAngle(b.theta - a.theta - z.theta)};
  }

  Eigen::Vector2d predicted;  // M.t
  Eigen::Vector3d error;
};

// B * D gives e * D, so that d e / d b = (R(e), 0; 0, 1).
// A * D gives Z^-1 D^-1 M, so that d e / d a = -(R(z)^T, R(z)^T turned(M.t); 0, 1). In place of M.t
// stands `lever`.
LinearisedPair<3, 3, 3> Linearised(const TurnedPose2& a,
                                   const TurnedPose2& b,
                                   const TurnedPose2& z,
                                   const PoseError& e,
                                   const Eigen::Vector2d& lever) {
  // R(e) = R(z)^T R(a)^T R(b).
  const double cosine_az = a.cosine * z.cosine - a.sine * z.sine;
  const double sine_az = a.sine * z.cosine + a.cosine * z.sine;
  const double cosine = cosine_az * b.cosine + sine_az * b.sine;
  const double sine = cosine_az * b.sine - sine_az * b.cosine;
  LinearisedPair<3, 3, 3> result;
  result.error = e.error;
  result.jacobian_a << -z.cosine, -z.sine, z.cosine * lever.y() - z.sine * lever.x(), z.sine,
      -z.cosine, -z.sine * lever.y() - z.cosine * lever.x(), 0.0, 0.0, -1.0;
  result.jacobian_b << cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0;
  return result;
}

}  // namespace

LinearisedPair<3, 3, 3> Linearised(const PoseGraph& graph, const GraphConstraint& constraint) {
  const TurnedPose2 a(graph.map_from_node[constraint.from]);
  const TurnedPose2 b(graph.map_from_node[constraint.to]);
  const TurnedPose2 z(constraint.from_from_to);
  const PoseError e(a, b, z);
  return Linearised(a, b, z, e, e.predicted);
}

void WritePoseTerm(const LinearisedPair<3, 3, 3>& linearised,
                   const Eigen::Matrix3d& weight,
                   double* values) {
  // The columns of both Jacobians, but for their last row: (0, 0, -1, 0, 0, 1).
  constexpr int kColumns = 6;
  const Eigen::Matrix3d& a = linearised.jacobian_a;
  const Eigen::Matrix3d& b = linearised.jacobian_b;
  const double top[kColumns] = {a(0, 0), a(0, 1), a(0, 2), b(0, 0), b(0, 1), 0.0};
  const double middle[kColumns] = {a(1, 0), a(1, 1), a(1, 2), b(1, 0), b(1, 1), 0.0};
  double weighted[kColumns][3];  // J^T W
  for (int k = 0; k < 3; ++k) {
    for (int c = 0; c < kColumns - 1; ++c) {
      weighted[c][k] = top[c] * weight(0, k) + middle[c] * weight(1, k);
    }
    weighted[2][k] -= weight(2, k);
    weighted[5][k] = weight(2, k);
  }
  const Eigen::Vector3d& e = linearised.error;
#pragma GCC unroll 6
  for (int c = 0; c < kColumns; ++c) {
    double* column = values + c * (kColumns + 1);
#pragma GCC unroll 6
    for (int r = c; r < kColumns - 1; ++r) {
      column[r] = weighted[r][0] * top[c] + weighted[r][1] * middle[c];
    }
    column[5] = weight(2, 0) * top[c] + weight(2, 1) * middle[c];
    column[6] = -(weighted[c][0] * e.x() + weighted[c][1] * e.y() + weighted[c][2] * e.z());
  }
  for (int r = 2; r < kColumns; ++r) {
    values[2 * (kColumns + 1) + r] -= weighted[r][2];
  }
  values[5 * (kColumns + 1) + 5] = weight(2, 2);
}

// With p the predicted point in A: A * D gives D^-1 p, so that d e / d a = -(I, turned(p)); the
// point moves in the map, so that d e / d l = R(a)^T.
LinearisedPair<2, 3, 2> Linearised(const PoseGraph& graph, const PointConstraint& constraint) {
  const Pose2& map_from_node = graph.map_from_node[constraint.from];
  const Eigen::Vector2d predicted = Inverse(map_from_node) * graph.points_in_map[constraint.point];
  LinearisedPair<2, 3, 2> result;
  result.error = predicted - constraint.point_in_from;
  result.jacobian_a.leftCols<2>() = -Eigen::Matrix2d::Identity();
  result.jacobian_a.col(2) = -Turned(predicted);
  result.jacobian_b = InverseRotation(map_from_node.theta);
  return result;
}

// With e = Z^-1 A: A * D gives e * D, as for the second node of a constraint.
LinearisedPrior<3, 3> Linearised(const PoseGraph& graph, const PosePrior& prior) {
  const Pose2 error = Inverse(prior.map_from_node) * graph.map_from_node[prior.node];
  LinearisedPrior<3, 3> result;
  result.error = error.vector();
  result.jacobian.setZero();
  result.jacobian.topLeftCorner<2, 2>() = InverseRotation(error.theta).transpose();
  result.jacobian(2, 2) = 1.0;
  return result;
}

// A * D moves the node by R(a) D.t.
LinearisedPrior<2, 3> Linearised(const PoseGraph& graph, const PositionPrior& prior) {
  LinearisedPrior<2, 3> result;
  result.error = ErrorOf(graph, prior);
  result.jacobian.setZero();
  result.jacobian.leftCols<2>() =
      InverseRotation(graph.map_from_node[prior.node].theta).transpose();
  return result;
}

PlaneProblem::PlaneProblem(PoseGraph& graph, const RobustKernel& kernel)
    : graph_(&graph), kernel_(kernel) {
  Gauge<3> gauge = FindGauge(graph);
  gauge_ties_ = std::move(gauge.ties);
  for (const bool node_is_held : gauge.held) {
    block_of_node_.push_back(node_is_held ? kHeldBlock
                                          : static_cast<std::uint32_t>(block_sizes_.size()));
    if (!node_is_held) {
      block_sizes_.push_back(3);
    }
  }
  nodes_.reserve(graph.map_from_node.size());
  for (const Pose2& node : graph.map_from_node) {
    nodes_.emplace_back(node);
  }
  measurements_.reserve(graph.constraints.size());
  for (const GraphConstraint& constraint : graph.constraints) {
    measurements_.emplace_back(constraint.from_from_to);
  }
  std::vector<bool> seen(graph.points_in_map.size());
  for (const PointConstraint& constraint : graph.point_constraints) {
    seen[constraint.point] = !graph.IsPointFixed(constraint.point);
  }
  for (const bool point_is_seen : seen) {
    block_of_point_.push_back(point_is_seen ? static_cast<std::uint32_t>(block_sizes_.size())
                                            : kHeldBlock);
    if (point_is_seen) {
      block_sizes_.push_back(2);
    }
  }
}

// One pair per constraint with two free ends, in the order in which Linearise counts them.
std::vector<BlockPair> PlaneProblem::Pairs() const {
  std::vector<BlockPair> pairs;
  const auto add = [&](std::uint32_t a, std::uint32_t b) {
    if (a != kHeldBlock && b != kHeldBlock) {
      pairs.push_back({a, b});
    }
  };
  for (const GraphConstraint& constraint : graph_->constraints) {
    add(block_of_node_[constraint.from], block_of_node_[constraint.to]);
  }
  for (const PointConstraint& constraint : graph_->point_constraints) {
    add(block_of_node_[constraint.from], block_of_point_[constraint.point]);
  }
  return pairs;
}

// One group per joint constraint with a free node, in their order.
std::vector<BlockGroup> PlaneProblem::Groups() const {
  std::vector<BlockGroup> groups;
  for (const JointConstraint& constraint : graph_->joint_constraints) {
    BlockGroup group;
    for (const std::uint32_t node : constraint.nodes) {
      if (block_of_node_[node] != kHeldBlock) {
        group.push_back(block_of_node_[node]);
      }
    }
    if (!group.empty()) {
      groups.push_back(std::move(group));
    }
  }
  return groups;
}

double PlaneProblem::Cost() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < graph_->constraints.size(); ++i) {
    const GraphConstraint& constraint = graph_->constraints[i];
    const Eigen::Vector3d error =
        PoseError(nodes_[constraint.from], nodes_[constraint.to], measurements_[i]).error;
    sum += Rho(error.dot(constraint.information * error), constraint.robust);
  }
  for (const PointConstraint& constraint : graph_->point_constraints) {
    sum += Rho(Chi2Of(*graph_, constraint), constraint.robust);
  }
  for (const PosePrior& prior : graph_->pose_priors) {
    sum += Rho(Chi2Of(*graph_, prior), prior.robust);
  }
  for (const PositionPrior& prior : graph_->position_priors) {
    sum += Rho(Chi2Of(*graph_, prior), prior.robust);
  }
  for (const JointConstraint& constraint : graph_->joint_constraints) {
    sum += Chi2Of(*graph_, constraint);
  }
  return sum;
}

void PlaneProblem::Linearise(NormalEquations& equations) const {
  Linearise(Levers::kPredicted, equations);
}

void PlaneProblem::Linearise(Levers levers, NormalEquations& equations) const {
  std::size_t pair = 0;
  const auto add = [&](const auto& constraint,
                       const auto& linearised,
                       std::uint32_t block_a,
                       std::uint32_t block_b) {
    const bool are_free = block_a != kHeldBlock && block_b != kHeldBlock;
    const auto add_weighted = [&](const auto& weight) {
      if constexpr (std::is_same_v<decltype(constraint), const GraphConstraint&>) {
        if (are_free) {
          WritePoseTerm(linearised, weight, equations.PairValues(pair));
          return;
        }
      }
      AddPair(linearised, weight, block_a, block_b, pair, equations);
    };
    if (constraint.robust && kernel_.shape != RobustKernel::Shape::kNone) {
      const double chi2 = linearised.error.dot(constraint.information * linearised.error);
      add_weighted((kernel_.Weight(chi2) * constraint.information).eval());
    } else {
      add_weighted(constraint.information);
    }
    pair += are_free ? 1 : 0;
  };
  for (std::size_t i = 0; i < graph_->constraints.size(); ++i) {
    const GraphConstraint& constraint = graph_->constraints[i];
    const TurnedPose2& a = nodes_[constraint.from];
    const TurnedPose2& b = nodes_[constraint.to];
    const TurnedPose2& z = measurements_[i];
    const PoseError e(a, b, z);
    const Eigen::Vector2d lever =
        levers == Levers::kMeasured ? Eigen::Vector2d(z.x, z.y) : e.predicted;
    add(constraint,
        Linearised(a, b, z, e, lever),
        block_of_node_[constraint.from],
        block_of_node_[constraint.to]);
  }
  for (const PointConstraint& constraint : graph_->point_constraints) {
    add(constraint,
        Linearised(*graph_, constraint),
        block_of_node_[constraint.from],
        block_of_point_[constraint.point]);
  }
  LinearisePriors(equations);
  LineariseJoints(equations);
}

void PlaneProblem::LineariseJoints(NormalEquations& equations) const {
  std::size_t group = 0;
  for (const JointConstraint& constraint : graph_->joint_constraints) {
    std::vector<bool> is_free;
    bool any_free = false;
    for (const std::uint32_t node : constraint.nodes) {
      is_free.push_back(block_of_node_[node] != kHeldBlock);
      any_free = any_free || is_free.back();
    }
    if (any_free) {
      WriteTerm(Linearised(*graph_, constraint),
                constraint.information,
                is_free,
                equations.GroupValues(group++));
    }
  }
}

void PlaneProblem::LinearisePriors(NormalEquations& equations) const {
  const auto add = [&](const auto& prior) {
    const auto linearised = Linearised(*graph_, prior);
    const double chi2 = linearised.error.dot(prior.information * linearised.error);
    const double weight_of_kernel = prior.robust ? kernel_.Weight(chi2) : 1.0;
    const auto weight = (weight_of_kernel * prior.information).eval();
    AddPrior(linearised, weight, block_of_node_[prior.node], equations);
  };
  for (const PosePrior& prior : graph_->pose_priors) {
    add(prior);
  }
  for (const PositionPrior& prior : graph_->position_priors) {
    add(prior);
  }
  for (const GaugeTie<3>& tie : gauge_ties_) {
    equations.AddDiagonal<3>(block_of_node_[tie.node], tie.information);
  }
}

void PlaneProblem::Move(const Eigen::VectorXd& step, const NormalEquations& equations) {
  for (std::size_t i = 0; i < block_of_node_.size(); ++i) {
    if (block_of_node_[i] == kHeldBlock) {
      continue;
    }
    const Eigen::Vector3d xi = step.segment<3>(equations.offset(block_of_node_[i]));
    const TurnedPose2& node = nodes_[i];
    const Pose2 moved{node.x + node.cosine * xi.x() - node.sine * xi.y(),
                      node.y + node.sine * xi.x() + node.cosine * xi.y(),
                      WrapAngle(node.theta + xi.z())};
    graph_->map_from_node[i] = moved;
    nodes_[i] = TurnedPose2(moved);
  }
  for (std::size_t i = 0; i < block_of_point_.size(); ++i) {
    if (block_of_point_[i] != kHeldBlock) {
      graph_->points_in_map[i] += step.segment<2>(equations.offset(block_of_point_[i]));
    }
  }
}

void PlaneProblem::Mark() {
  nodes_before_ = graph_->map_from_node;
  turned_before_ = nodes_;
  points_before_ = graph_->points_in_map;
}

void PlaneProblem::Restore(const State& state) {
  graph_->map_from_node = state.map_from_node;
  graph_->points_in_map = state.points_in_map;
  nodes_.clear();
  for (const Pose2& node : state.map_from_node) {
    nodes_.emplace_back(node);
  }
}

void PlaneProblem::MoveBack() {
  graph_->map_from_node = nodes_before_;
  nodes_ = turned_before_;
  graph_->points_in_map = points_before_;
}

}  // namespace loci
