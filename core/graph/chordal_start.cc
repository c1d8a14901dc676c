// SPDX-License-Identifier: Apache-2.0
// Two linear problems over the normal equations.
#include "core/graph/chordal_start.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "core/base/math.h"
#include "core/graph/normal_equations.h"
#include "core/graph/toro_tree.h"

namespace loci {
namespace {

// A constraint without information ties with this part of the strongest one's, so that the problems
// have one solution.
constexpr double kWeightMinRelative = 1e-6;

template <typename Graph>
struct Traits;

template <>
struct Traits<PoseGraph> {
  static constexpr int kDimension = 2;
  // The second row of a turned frame is the first one turned.
  static constexpr int kRows = 1;

  static Eigen::Matrix2d Rotation(const Pose2& pose) {
    Eigen::Matrix2d rotation;
    rotation << Cos(pose.theta), -Sin(pose.theta), Sin(pose.theta), Cos(pose.theta);
    return rotation;
  }
  static Eigen::Vector2d Translation(const Pose2& pose) { return pose.translation(); }
  static void SetTranslation(const Eigen::Vector2d& translation, Pose2& pose) {
    pose.x = translation.x();
    pose.y = translation.y();
  }
  static void SetNearestRotation(const Eigen::Matrix2d& rows, Pose2& pose) {
    pose.theta = Atan2(-rows(0, 1), rows(0, 0));
  }
};

template <>
struct Traits<SpaceGraph> {
  static constexpr int kDimension = 3;
  static constexpr int kRows = 3;

  static Eigen::Matrix3d Rotation(const Pose3& pose) { return pose.rotation.toRotationMatrix(); }
  static Eigen::Vector3d Translation(const Pose3& pose) { return pose.translation; }
  static void SetTranslation(const Eigen::Vector3d& translation, Pose3& pose) {
    pose.translation = translation;
  }
  static void SetNearestRotation(const Eigen::Matrix3d& rows, Pose3& pose) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(rows, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign =
        (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
    const Eigen::Matrix3d rotation =
        svd.matrixU() * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
    pose.rotation = Eigen::Quaterniond(rotation).normalized();
  }
};

template <typename Graph>
class ChordalStart {
 public:
  explicit ChordalStart(Graph& graph) : graph_(graph), tree_(BreadthFirstTree(graph)) {}

  void Place() {
    PlaceRotations();
    PlacePositions();
  }

 private:
  static constexpr int kDimension = Traits<Graph>::kDimension;
  static constexpr int kRows = Traits<Graph>::kRows;
  using Vector = Eigen::Matrix<double, kDimension, 1>;
  using Matrix = Eigen::Matrix<double, kDimension, kDimension>;
  using Linear = LinearisedPair<kDimension, kDimension, kDimension>;

  // Rotations are known of fixed nodes and of the roots of the tree.
  void PlaceRotations() {
    std::vector<std::uint32_t> block_of_node;
    std::uint32_t block_count = 0;
    for (std::size_t i = 0; i < graph_.map_from_node.size(); ++i) {
      const bool held = graph_.IsFixed(i) || tree_.parent[i] == ToroTree::kNone;
      block_of_node.push_back(held ? kHeldBlock : block_count++);
    }
    std::vector<BlockPair> pairs;
    for (const auto& constraint : graph_.constraints) {
      AddBlockPair(block_of_node[constraint.from], block_of_node[constraint.to], pairs);
    }
    NormalEquations equations(std::vector<int>(block_count, kDimension), pairs);
    const std::vector<double> weights = RotationWeights();
    std::vector<Matrix> rows(graph_.map_from_node.size(), Matrix::Zero());
    for (int row = 0; row < kRows; ++row) {
      LineariseRotations(row, weights, block_of_node, equations);
      if (!equations.Factor(/*damping=*/0.0)) {
        return;
      }
      const Eigen::VectorXd solution = equations.Step();
      for (std::size_t i = 0; i < rows.size(); ++i) {
        if (block_of_node[i] != kHeldBlock) {
          rows[i].row(row) =
              solution.segment<kDimension>(equations.offset(block_of_node[i])).transpose();
        }
      }
    }
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (block_of_node[i] != kHeldBlock) {
        Traits<Graph>::SetNearestRotation(rows[i], graph_.map_from_node[i]);
      }
    }
  }

  // With x_i a row of R_i: R_to = R_from Z says x_to = Z^T x_from.
  void LineariseRotations(int row,
                          const std::vector<double>& weights,
                          const std::vector<std::uint32_t>& block_of_node,
                          NormalEquations& equations) const {
    const auto known = [&](std::uint32_t node) -> Vector {
      if (block_of_node[node] != kHeldBlock) {
        return Vector::Zero();
      }
      return Traits<Graph>::Rotation(graph_.map_from_node[node]).row(row).transpose();
    };
    equations.Clear();
    std::size_t pair = 0;
    for (std::size_t i = 0; i < graph_.constraints.size(); ++i) {
      const auto& constraint = graph_.constraints[i];
      Linear linear;
      linear.jacobian_a = -Traits<Graph>::Rotation(constraint.from_from_to).transpose();
      linear.jacobian_b = Matrix::Identity();
      linear.error = known(constraint.to) + linear.jacobian_a * known(constraint.from);
      AddLinear(linear,
                weights[i] * Matrix::Identity(),
                block_of_node[constraint.from],
                block_of_node[constraint.to],
                pair,
                equations);
    }
  }

  std::vector<double> RotationWeights() const {
    std::vector<double> weights;
    double largest = 0.0;
    for (const auto& constraint : graph_.constraints) {
      const auto& information = constraint.information;
      const double turn = information.trace() -
                          information.template topLeftCorner<kDimension, kDimension>().trace();
      weights.push_back(turn / static_cast<double>(information.rows() - kDimension));
      largest = std::max(largest, weights.back());
    }
    for (double& weight : weights) {
      weight = std::max(weight, largest > 0.0 ? kWeightMinRelative * largest : 1.0);
    }
    return weights;
  }

  // Positions are known of fixed nodes and points, and of the first root of each component.
  void PlacePositions() {
    std::vector<int> sizes;
    const auto new_block = [&] {
      sizes.push_back(kDimension);
      return static_cast<std::uint32_t>(sizes.size() - 1);
    };
    const std::vector<bool> held = HeldPositions();
    std::vector<std::uint32_t> block_of_node;
    for (const bool node_is_held : held) {
      block_of_node.push_back(node_is_held ? kHeldBlock : new_block());
    }
    std::vector<bool> free_point(graph_.points_in_map.size());
    for (const auto& constraint : graph_.point_constraints) {
      free_point[constraint.point] = !graph_.IsPointFixed(constraint.point);
    }
    std::vector<std::uint32_t> block_of_point;
    for (const bool is_free : free_point) {
      block_of_point.push_back(is_free ? new_block() : kHeldBlock);
    }
    std::vector<BlockPair> pairs;
    for (const auto& constraint : graph_.constraints) {
      AddBlockPair(block_of_node[constraint.from], block_of_node[constraint.to], pairs);
    }
    for (const auto& constraint : graph_.point_constraints) {
      AddBlockPair(block_of_node[constraint.from], block_of_point[constraint.point], pairs);
    }
    NormalEquations equations(sizes, pairs);
    LinearisePositions(block_of_node, block_of_point, equations);
    if (!equations.Factor(/*damping=*/0.0)) {
      return;
    }
    const Eigen::VectorXd step = equations.Step();
    for (std::size_t i = 0; i < block_of_node.size(); ++i) {
      if (block_of_node[i] != kHeldBlock) {
        auto& pose = graph_.map_from_node[i];
        Traits<Graph>::SetTranslation(
            Traits<Graph>::Translation(pose) +
                step.segment<kDimension>(equations.offset(block_of_node[i])),
            pose);
      }
    }
    for (std::size_t i = 0; i < block_of_point.size(); ++i) {
      if (block_of_point[i] != kHeldBlock) {
        graph_.points_in_map[i] += step.segment<kDimension>(equations.offset(block_of_point[i]));
      }
    }
  }

  std::vector<bool> HeldPositions() const {
    const GraphComponents components = FindComponents(graph_);
    std::vector<bool> has_held(components.count);
    std::vector<bool> held(graph_.map_from_node.size());
    for (std::size_t i = 0; i < held.size(); ++i) {
      held[i] = graph_.IsFixed(i);
      has_held[components.of_node[i]] = has_held[components.of_node[i]] || held[i];
    }
    for (const std::uint32_t node : tree_.order) {
      if (!has_held[components.of_node[node]]) {
        has_held[components.of_node[node]] = true;
        held[node] = true;
      }
    }
    return held;
  }

  // In the map: t_to - t_from - R_from z, with the information turned there; l - t_from - R_from z
  // for a point.
  void LinearisePositions(const std::vector<std::uint32_t>& block_of_node,
                          const std::vector<std::uint32_t>& block_of_point,
                          NormalEquations& equations) const {
    double largest = 0.0;
    for (const auto& constraint : graph_.constraints) {
      largest = std::max(
          largest, constraint.information.template topLeftCorner<kDimension, kDimension>().trace());
    }
    for (const auto& constraint : graph_.point_constraints) {
      largest = std::max(largest, constraint.information.trace());
    }
    const Matrix least = (largest > 0.0 ? kWeightMinRelative * largest : 1.0) * Matrix::Identity();
    equations.Clear();
    std::size_t pair = 0;
    Linear linear;
    linear.jacobian_a = -Matrix::Identity();
    linear.jacobian_b = Matrix::Identity();
    for (const auto& constraint : graph_.constraints) {
      const auto& from = graph_.map_from_node[constraint.from];
      const Matrix rotation = Traits<Graph>::Rotation(from);
      const Matrix measured_in_map = rotation * Traits<Graph>::Rotation(constraint.from_from_to);
      const Matrix information =
          constraint.information.template topLeftCorner<kDimension, kDimension>() + least;
      linear.error = Traits<Graph>::Translation(graph_.map_from_node[constraint.to]) -
                     Traits<Graph>::Translation(from) -
                     rotation * Traits<Graph>::Translation(constraint.from_from_to);
      AddLinear(linear,
                measured_in_map * information * measured_in_map.transpose(),
                block_of_node[constraint.from],
                block_of_node[constraint.to],
                pair,
                equations);
    }
    for (const auto& constraint : graph_.point_constraints) {
      const auto& from = graph_.map_from_node[constraint.from];
      const Matrix rotation = Traits<Graph>::Rotation(from);
      linear.error = graph_.points_in_map[constraint.point] - Traits<Graph>::Translation(from) -
                     rotation * constraint.point_in_from;
      AddLinear(linear,
                rotation * (constraint.information + least) * rotation.transpose(),
                block_of_node[constraint.from],
                block_of_point[constraint.point],
                pair,
                equations);
    }
  }

  static void AddBlockPair(std::uint32_t a, std::uint32_t b, std::vector<BlockPair>& pairs) {
    if (a != kHeldBlock && b != kHeldBlock) {
      pairs.push_back({a, b});
    }
  }

  static void AddLinear(const Linear& linear,
                        const Matrix& weight,
                        std::uint32_t block_a,
                        std::uint32_t block_b,
                        std::size_t& pair,
                        NormalEquations& equations) {
    AddPair(linear, weight, block_a, block_b, pair, equations);
    pair += block_a != kHeldBlock && block_b != kHeldBlock ? 1 : 0;
  }

  Graph& graph_;
  ToroTree tree_;
};

}  // namespace

void PlaceByChords(PoseGraph& graph) {
  ChordalStart<PoseGraph>(graph).Place();
}

void PlaceByChords(SpaceGraph& graph) {
  ChordalStart<SpaceGraph>(graph).Place();
}

}  // namespace loci
