// SPDX-License-Identifier: Apache-2.0
// Analytic Jacobians of the constraints in space, and Gauss-Newton over them.
#include "core/graph/space_problem.h"

#include <cstddef>
#include <utility>

#include "core/base/math.h"
#include "core/graph/align_to_priors.h"
#include "core/graph/gauge.h"
#include "core/graph/least_squares.h"

namespace loci {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

// The cross product with v as a matrix.
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

// With w >= 0: the error takes the vector part of this one, and the Jacobians are linear in it.
Pose3 WithPositiveScalar(Pose3 pose) {
  if (pose.rotation.w() < 0.0) {
    pose.rotation.coeffs() = -pose.rotation.coeffs();
  }
  return pose;
}

Vector6 ErrorVector(const Pose3& error) {
  Vector6 vector;
  vector << error.translation, error.rotation.vec();
  return vector;
}

// d vec(q * (1, w / 2)) / d w at w = 0.
Eigen::Matrix3d QuaternionJacobian(const Eigen::Quaterniond& q) {
  return 0.5 * (q.w() * Eigen::Matrix3d::Identity() + CrossMatrix(q.vec()));
}

// map_from_node moved by (translation, rotation vector) in its own frame.
Pose3 Moved(const Pose3& map_from_node, const Vector6& xi) {
  const Eigen::Vector3d turn = xi.tail<3>();
  const double angle_rad = turn.norm();
  const double half_sine_by_angle = angle_rad < 1e-9 ? 0.5 : Sin(0.5 * angle_rad) / angle_rad;
  const Eigen::Vector3d vector = half_sine_by_angle * turn;
  const Eigen::Quaterniond rotation(Cos(0.5 * angle_rad), vector.x(), vector.y(), vector.z());
  return map_from_node * Pose3{xi.head<3>(), rotation.normalized()};
}

// Blocks: free nodes, then free points that have a constraint.
class SpaceProblem final : public LeastSquaresProblem {
 public:
  explicit SpaceProblem(SpaceGraph& graph) : graph_(&graph) {
    Gauge<6> gauge = FindGauge(graph);
    gauge_ties_ = std::move(gauge.ties);
    for (const bool held : gauge.held) {
      block_of_node_.push_back(held ? kHeldBlock : NewBlock(6));
    }
    std::vector<bool> free_point(graph.points_in_map.size());
    for (const SpacePointConstraint& constraint : graph.point_constraints) {
      free_point[constraint.point] = !graph.IsPointFixed(constraint.point);
    }
    for (const bool is_free : free_point) {
      block_of_point_.push_back(is_free ? NewBlock(3) : kHeldBlock);
    }
  }

  std::vector<int> BlockSizes() const override { return block_sizes_; }

  std::vector<BlockPair> Pairs() const override {
    std::vector<BlockPair> pairs;
    const auto add = [&](std::uint32_t a, std::uint32_t b) {
      if (a != kHeldBlock && b != kHeldBlock) {
        pairs.push_back({a, b});
      }
    };
    for (const SpaceConstraint& constraint : graph_->constraints) {
      add(block_of_node_[constraint.from], block_of_node_[constraint.to]);
    }
    for (const SpacePointConstraint& constraint : graph_->point_constraints) {
      add(block_of_node_[constraint.from], block_of_point_[constraint.point]);
    }
    return pairs;
  }

  double Cost() const override { return Chi2(*graph_); }

  void Linearise(NormalEquations& equations) const override {
    std::size_t pair = 0;
    const auto add = [&](const auto& constraint, std::uint32_t block_a, std::uint32_t block_b) {
      AddPair(Linearised(*graph_, constraint),
              constraint.information,
              block_a,
              block_b,
              pair,
              equations);
      pair += block_a != kHeldBlock && block_b != kHeldBlock ? 1 : 0;
    };
    for (const SpaceConstraint& constraint : graph_->constraints) {
      add(constraint, block_of_node_[constraint.from], block_of_node_[constraint.to]);
    }
    for (const SpacePointConstraint& constraint : graph_->point_constraints) {
      add(constraint, block_of_node_[constraint.from], block_of_point_[constraint.point]);
    }
    const auto add_prior = [&](const auto& prior) {
      AddPrior(
          Linearised(*graph_, prior), prior.information, block_of_node_[prior.node], equations);
    };
    for (const SpacePosePrior& prior : graph_->pose_priors) {
      add_prior(prior);
    }
    for (const SpacePositionPrior& prior : graph_->position_priors) {
      add_prior(prior);
    }
    for (const GaugeTie<6>& tie : gauge_ties_) {
      equations.AddDiagonal<6>(block_of_node_[tie.node], tie.information);
    }
  }

  void Move(const Eigen::VectorXd& step, const NormalEquations& equations) override {
    for (std::size_t i = 0; i < block_of_node_.size(); ++i) {
      if (block_of_node_[i] != kHeldBlock) {
        graph_->map_from_node[i] =
            Moved(graph_->map_from_node[i], step.segment<6>(equations.offset(block_of_node_[i])));
      }
    }
    for (std::size_t i = 0; i < block_of_point_.size(); ++i) {
      if (block_of_point_[i] != kHeldBlock) {
        graph_->points_in_map[i] += step.segment<3>(equations.offset(block_of_point_[i]));
      }
    }
  }

  void Mark() override {
    nodes_before_ = graph_->map_from_node;
    points_before_ = graph_->points_in_map;
  }

  void MoveBack() override {
    graph_->map_from_node = nodes_before_;
    graph_->points_in_map = points_before_;
  }

 private:
  std::uint32_t NewBlock(int size) {
    block_sizes_.push_back(size);
    return static_cast<std::uint32_t>(block_sizes_.size() - 1);
  }

  SpaceGraph* graph_;
  std::vector<GaugeTie<6>> gauge_ties_;
  std::vector<int> block_sizes_;
  std::vector<std::uint32_t> block_of_node_;
  std::vector<std::uint32_t> block_of_point_;
  std::vector<Pose3> nodes_before_;
  std::vector<Eigen::Vector3d> points_before_;
};

}  // namespace

// With M = A^-1 B and E = Z^-1 M, and a small motion D = (t, w), whose quaternion is (1, w / 2):
// B * D gives E * D: d t = R(e) t, d q = q(e) * (0, w / 2), whose vector part is
// (w_e I + [v_e]) w / 2.
// A * D gives Z^-1 D^-1 M: d t = R(z)^T (-t + [M.t] w), and d q = (0, -R(z)^T w / 2) * q(e), whose
// vector part is -(w_e I - [v_e]) R(z)^T w / 2.
LinearisedPair<6, 6, 6> Linearised(const SpaceGraph& graph, const SpaceConstraint& constraint) {
  const Pose3 predicted =
      Inverse(graph.map_from_node[constraint.from]) * graph.map_from_node[constraint.to];
  const Pose3 error = WithPositiveScalar(Inverse(constraint.from_from_to) * predicted);
  const Eigen::Matrix3d measured_inverse =
      constraint.from_from_to.rotation.conjugate().toRotationMatrix();
  LinearisedPair<6, 6, 6> result;
  result.error = ErrorVector(error);
  result.jacobian_a.setZero();
  result.jacobian_a.topLeftCorner<3, 3>() = -measured_inverse;
  result.jacobian_a.topRightCorner<3, 3>() = measured_inverse * CrossMatrix(predicted.translation);
  result.jacobian_a.bottomRightCorner<3, 3>() =
      -QuaternionJacobian(error.rotation.conjugate()) * measured_inverse;
  result.jacobian_b.setZero();
  result.jacobian_b.topLeftCorner<3, 3>() = error.rotation.toRotationMatrix();
  result.jacobian_b.bottomRightCorner<3, 3>() = QuaternionJacobian(error.rotation);
  return result;
}

// With p the predicted point in A: A * D gives D^-1 p, so that d p = -t + [p] w; the point moves in
// the map, so that d e / d l = R(a)^T.
LinearisedPair<3, 6, 3> Linearised(const SpaceGraph& graph,
                                   const SpacePointConstraint& constraint) {
  LinearisedPair<3, 6, 3> result;
  result.error = ErrorOf(graph, constraint);
  const Eigen::Vector3d predicted = result.error + constraint.point_in_from;
  result.jacobian_a.leftCols<3>() = -Eigen::Matrix3d::Identity();
  result.jacobian_a.rightCols<3>() = CrossMatrix(predicted);
  result.jacobian_b = graph.map_from_node[constraint.from].rotation.conjugate().toRotationMatrix();
  return result;
}

// With E = Z^-1 A P: A * D gives Z^-1 A D P. D P moves the sensor by t + w x P.t in the node's
// frame, and q(e) becomes q(e) * (P^-1 (0, w / 2) P) = q(e) * (0, R(p)^T w / 2).
LinearisedPrior<6, 6> Linearised(const SpaceGraph& graph, const SpacePosePrior& prior) {
  const Pose3 measured_from_map = Inverse(prior.map_from_sensor);
  const Pose3& map_from_node = graph.map_from_node[prior.node];
  const Pose3 error =
      WithPositiveScalar(measured_from_map * (map_from_node * prior.node_from_sensor));
  const Eigen::Matrix3d measured_from_node =
      (measured_from_map.rotation * map_from_node.rotation).toRotationMatrix();
  LinearisedPrior<6, 6> result;
  result.error = ErrorVector(error);
  result.jacobian.setZero();
  result.jacobian.topLeftCorner<3, 3>() = measured_from_node;
  result.jacobian.topRightCorner<3, 3>() =
      -measured_from_node * CrossMatrix(prior.node_from_sensor.translation);
  result.jacobian.bottomRightCorner<3, 3>() =
      QuaternionJacobian(error.rotation) *
      prior.node_from_sensor.rotation.conjugate().toRotationMatrix();
  return result;
}

LinearisedPrior<3, 6> Linearised(const SpaceGraph& graph, const SpacePositionPrior& prior) {
  LinearisedPrior<3, 6> result;
  result.error = ErrorOf(graph, prior);
  result.jacobian.setZero();
  result.jacobian.leftCols<3>() = graph.map_from_node[prior.node].rotation.toRotationMatrix();
  return result;
}

OptimizationSummary OptimizeSparse(SpaceGraph& graph, const SparseOptions& options) {
  const double gained = AlignToPriors(graph);
  SpaceProblem problem(graph);
  const LeastSquaresSummary minimised = Minimise(problem, LeastSquaresOptionsFrom(options));
  OptimizationSummary summary;
  summary.iterations = minimised.iterations;
  summary.chi2_before = minimised.cost_before + gained;
  summary.chi2_after = minimised.cost_after;
  summary.cost_before = summary.chi2_before;
  summary.cost_after = minimised.cost_after;
  summary.converged = minimised.converged;
  return summary;
}

}  // namespace loci
