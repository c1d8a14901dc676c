// SPDX-License-Identifier: Apache-2.0
// Error, Jacobians and optimisation of pose graphs in space.
#include "core/graph/space_graph.h"

#include <cmath>
#include <string>

#include <Eigen/Eigenvalues>

#include "core/base/math.h"
#include "core/graph/information.h"
#include "core/graph/least_squares.h"

namespace loci {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// The cross product with v as a matrix.
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

// The same nodes and constraints without their numbers: held nodes and trees depend on these alone.
PoseGraph TopologyOf(const SpaceGraph& graph) {
  PoseGraph topology;
  topology.map_from_node.resize(graph.map_from_node.size());
  topology.fixed = graph.fixed;
  topology.constraints.resize(graph.constraints.size());
  for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
    topology.constraints[i].from = graph.constraints[i].from;
    topology.constraints[i].to = graph.constraints[i].to;
  }
  return topology;
}

Pose3 ErrorPose(const SpaceGraph& graph, const SpaceConstraint& constraint) {
  const Pose3 predicted =
      Inverse(graph.map_from_node[constraint.from]) * graph.map_from_node[constraint.to];
  Pose3 error = Inverse(constraint.from_from_to) * predicted;
  if (error.rotation.w() < 0.0) {
    error.rotation.coeffs() = -error.rotation.coeffs();
  }
  return error;
}

Vector6 ErrorVector(const Pose3& error) {
  Vector6 vector;
  vector << error.translation, error.rotation.vec();
  return vector;
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

class SpaceProblem final : public LeastSquaresProblem {
 public:
  explicit SpaceProblem(SpaceGraph& graph) : graph_(&graph) {
    for (const bool held : HeldNodes(TopologyOf(graph))) {
      block_of_node_.push_back(held ? kHeldBlock : block_count_++);
    }
  }

  std::vector<int> BlockSizes() const override { return std::vector<int>(block_count_, 6); }

  std::vector<BlockPair> Pairs() const override {
    std::vector<BlockPair> pairs;
    for (const SpaceConstraint& constraint : graph_->constraints) {
      if (block_of_node_[constraint.from] != kHeldBlock &&
          block_of_node_[constraint.to] != kHeldBlock) {
        pairs.push_back({block_of_node_[constraint.from], block_of_node_[constraint.to]});
      }
    }
    return pairs;
  }

  double Cost() const override { return Chi2(*graph_); }

  void Linearise(NormalEquations& equations) const override {
    std::size_t pair = 0;
    for (const SpaceConstraint& constraint : graph_->constraints) {
      const std::uint32_t block_a = block_of_node_[constraint.from];
      const std::uint32_t block_b = block_of_node_[constraint.to];
      AddPair(Linearised(*graph_, constraint),
              constraint.information,
              block_a,
              block_b,
              pair,
              equations);
      pair += block_a != kHeldBlock && block_b != kHeldBlock ? 1 : 0;
    }
  }

  void Move(const Eigen::VectorXd& step, const NormalEquations& equations) override {
    nodes_before_ = graph_->map_from_node;
    for (std::size_t i = 0; i < block_of_node_.size(); ++i) {
      if (block_of_node_[i] != kHeldBlock) {
        graph_->map_from_node[i] =
            Moved(graph_->map_from_node[i], step.segment<6>(equations.offset(block_of_node_[i])));
      }
    }
  }

  void MoveBack() override { graph_->map_from_node = nodes_before_; }

 private:
  SpaceGraph* graph_;
  std::uint32_t block_count_ = 0;
  std::vector<std::uint32_t> block_of_node_;
  std::vector<Pose3> nodes_before_;
};

}  // namespace

Eigen::Matrix<double, 6, 1> ErrorOf(const SpaceGraph& graph, const SpaceConstraint& constraint) {
  return ErrorVector(ErrorPose(graph, constraint));
}

double Chi2(const SpaceGraph& graph) {
  double sum = 0.0;
  for (const SpaceConstraint& constraint : graph.constraints) {
    const Vector6 error = ErrorOf(graph, constraint);
    sum += error.dot(constraint.information * error);
  }
  return sum;
}

Status ValidateGraph(const SpaceGraph& graph) {
  const std::size_t count = graph.map_from_node.size();
  for (std::size_t i = 0; i < count; ++i) {
    const Pose3& pose = graph.map_from_node[i];
    if (!pose.translation.allFinite() || !pose.rotation.coeffs().allFinite()) {
      return InvalidArgumentError("map_from_node[" + std::to_string(i) +
                                  "]: a number is not finite");
    }
  }
  for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
    const SpaceConstraint& constraint = graph.constraints[i];
    const std::string name = "constraints[" + std::to_string(i) + "]";
    if (constraint.from >= count || constraint.to >= count || constraint.from == constraint.to) {
      return InvalidArgumentError(name + ": joins nodes " + std::to_string(constraint.from) +
                                  " and " + std::to_string(constraint.to) +
                                  ", must be two different ones < " + std::to_string(count));
    }
    if (!constraint.from_from_to.translation.allFinite() ||
        !constraint.from_from_to.rotation.coeffs().allFinite()) {
      return InvalidArgumentError(name + ".from_from_to: a number is not finite");
    }
    LOCI_RETURN_IF_ERROR(ValidateInformation(constraint.information, name + ".information"));
  }
  return {};
}

GraphComponents FindComponents(const SpaceGraph& graph) {
  return FindComponents(TopologyOf(graph));
}

ToroTree BreadthFirstTree(const SpaceGraph& graph) {
  return BreadthFirstTree(TopologyOf(graph));
}

void PlaceByTree(const ToroTree& tree, SpaceGraph& graph) {
  for (const std::uint32_t node : tree.order) {
    if (tree.parent[node] == ToroTree::kNone) {
      continue;
    }
    const SpaceConstraint& constraint = graph.constraints[tree.parent_constraint[node]];
    graph.map_from_node[node] =
        graph.map_from_node[tree.parent[node]] *
        (constraint.to == node ? constraint.from_from_to : Inverse(constraint.from_from_to));
  }
}

// With M = A^-1 B and E = Z^-1 M, and a small motion D = (t, w), whose quaternion is (1, w / 2):
// B * D gives E * D: d t = R(e) t, d q = q(e) * (0, w / 2), whose vector part is
// (w_e I + [v_e]) w / 2.
// A * D gives Z^-1 D^-1 M: d t = R(z)^T (-t + [M.t] w), and d q = (0, -R(z)^T w / 2) * q(e), whose
// vector part is -(w_e I - [v_e]) R(z)^T w / 2.
// g2o's error takes q with w >= 0; ErrorPose has turned its sign already, and both are linear in
// it.
LinearisedPair<6, 6, 6> Linearised(const SpaceGraph& graph, const SpaceConstraint& constraint) {
  const Pose3 predicted =
      Inverse(graph.map_from_node[constraint.from]) * graph.map_from_node[constraint.to];
  const Pose3 error = ErrorPose(graph, constraint);
  const Eigen::Matrix3d measured_inverse =
      constraint.from_from_to.rotation.conjugate().toRotationMatrix();
  const Eigen::Matrix3d scalar_part = error.rotation.w() * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d vector_part = CrossMatrix(error.rotation.vec());
  LinearisedPair<6, 6, 6> result;
  result.error = ErrorVector(error);
  result.jacobian_a.setZero();
  result.jacobian_a.topLeftCorner<3, 3>() = -measured_inverse;
  result.jacobian_a.topRightCorner<3, 3>() = measured_inverse * CrossMatrix(predicted.translation);
  result.jacobian_a.bottomRightCorner<3, 3>() =
      -0.5 * (scalar_part - vector_part) * measured_inverse;
  result.jacobian_b.setZero();
  result.jacobian_b.topLeftCorner<3, 3>() = error.rotation.toRotationMatrix();
  result.jacobian_b.bottomRightCorner<3, 3>() = 0.5 * (scalar_part + vector_part);
  return result;
}

OptimizationSummary OptimizeSparse(SpaceGraph& graph, const SparseOptions& options) {
  SpaceProblem problem(graph);
  const LeastSquaresSummary minimised = Minimise(problem, LeastSquaresOptionsFrom(options));
  OptimizationSummary summary;
  summary.iterations = minimised.iterations;
  summary.chi2_before = minimised.cost_before;
  summary.chi2_after = minimised.cost_after;
  summary.cost_before = minimised.cost_before;
  summary.cost_after = minimised.cost_after;
  summary.converged = minimised.converged;
  return summary;
}

}  // namespace loci
