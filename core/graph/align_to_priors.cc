// SPDX-License-Identifier: Apache-2.0
// Weighted rigid alignment of each component.
#include "core/graph/align_to_priors.h"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "core/base/math.h"

namespace loci {
namespace {

// Of two turns that fit alike, the smaller one is taken: the identity counts as seen with this part
// of what else was seen.
constexpr double kIdentityWeight = 1e-9;

Eigen::Matrix2d RotationOf(const Pose2& pose) {
  Eigen::Matrix2d rotation;
  rotation << Cos(pose.theta), -Sin(pose.theta), Sin(pose.theta), Cos(pose.theta);
  return rotation;
}
Eigen::Matrix3d RotationOf(const Pose3& pose) {
  return pose.rotation.toRotationMatrix();
}

Eigen::Vector2d TranslationOf(const Pose2& pose) {
  return pose.translation();
}
Eigen::Vector3d TranslationOf(const Pose3& pose) {
  return pose.translation;
}

Eigen::Vector2d Apply(const Pose2& a_from_b, const Eigen::Vector2d& point_in_b) {
  return a_from_b * point_in_b;
}
Eigen::Vector3d Apply(const Pose3& a_from_b, const Eigen::Vector3d& point_in_b) {
  return a_from_b.rotation * point_in_b + a_from_b.translation;
}

Pose2 PoseOf(const Eigen::Matrix2d& rotation, const Eigen::Vector2d& translation) {
  return {translation.x(), translation.y(), Atan2(rotation(1, 0), rotation(0, 0))};
}
Pose3 PoseOf(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
  return {translation, Eigen::Quaterniond(rotation).normalized()};
}

Pose2 MeasuredNode(const PosePrior& prior) {
  return prior.map_from_node;
}
Pose3 MeasuredNode(const SpacePosePrior& prior) {
  return prior.map_from_sensor * Inverse(prior.node_from_sensor);
}

// Pairs of points and of rotations, `from` as they are and `to` as they should be.
template <int kDimension>
class Alignment {
 public:
  using Vector = Eigen::Matrix<double, kDimension, 1>;
  using Matrix = Eigen::Matrix<double, kDimension, kDimension>;

  void AddPoint(const Vector& from, const Vector& to, double weight) {
    points_.push_back({from, to, weight});
    weight_ += weight;
    mean_from_ += weight * from;
    mean_to_ += weight * to;
  }

  void AddRotation(const Matrix& from, const Matrix& to, double weight) {
    correlation_ += weight * to * from.transpose();
  }

  // False if nothing was added.
  bool Solve(Matrix& rotation, Vector& translation) const {
    Matrix correlation = correlation_;
    const Vector mean_from = weight_ > 0.0 ? Vector(mean_from_ / weight_) : Vector::Zero().eval();
    const Vector mean_to = weight_ > 0.0 ? Vector(mean_to_ / weight_) : Vector::Zero().eval();
    for (const Pair& pair : points_) {
      correlation += pair.weight * (pair.to - mean_to) * (pair.from - mean_from).transpose();
    }
    if (weight_ <= 0.0 && correlation.isZero(0.0)) {
      return false;
    }
    // Points that coincide leave rounding only; that is no turn.
    const double scale = correlation.cwiseAbs().maxCoeff() +
                         1e-6 * weight_ * (1.0 + mean_to.squaredNorm() + mean_from.squaredNorm());
    correlation += kIdentityWeight * scale * Matrix::Identity();
    const Eigen::JacobiSVD<Matrix> svd(correlation, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Vector signs = Vector::Ones();
    signs(kDimension - 1) =
        (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
    rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
    translation = weight_ > 0.0 ? Vector(mean_to - rotation * mean_from) : Vector::Zero().eval();
    return true;
  }

 private:
  struct Pair {
    Vector from;
    Vector to;
    double weight;
  };
  std::vector<Pair> points_;
  double weight_ = 0.0;
  Vector mean_from_ = Vector::Zero();
  Vector mean_to_ = Vector::Zero();
  Matrix correlation_ = Matrix::Zero();
};

template <typename Term>
double Cost(const PoseGraph& graph, const Term& term, const RobustKernel& kernel) {
  const double chi2 = Chi2Of(graph, term);
  return term.robust ? kernel.Rho(chi2) : chi2;
}
template <typename Term>
double Cost(const SpaceGraph& graph, const Term& term, const RobustKernel& /*kernel*/) {
  const auto error = ErrorOf(graph, term);
  return error.dot(term.information * error);
}

// The cost of priors and of fixed points, by component.
template <typename Graph>
std::vector<double> CostOfTies(const Graph& graph,
                               const GraphComponents& components,
                               const RobustKernel& kernel) {
  std::vector<double> cost(components.count, 0.0);
  for (const auto& prior : graph.pose_priors) {
    cost[components.of_node[prior.node]] += Cost(graph, prior, kernel);
  }
  for (const auto& prior : graph.position_priors) {
    cost[components.of_node[prior.node]] += Cost(graph, prior, kernel);
  }
  for (const auto& constraint : graph.point_constraints) {
    if (graph.IsPointFixed(constraint.point)) {
      cost[components.of_node[constraint.from]] += Cost(graph, constraint, kernel);
    }
  }
  return cost;
}

template <int kDimension, typename Graph>
std::vector<Alignment<kDimension>> FindAlignments(const Graph& graph,
                                                  const GraphComponents& components) {
  std::vector<Alignment<kDimension>> alignments(components.count);
  for (const auto& prior : graph.pose_priors) {
    Alignment<kDimension>& alignment = alignments[components.of_node[prior.node]];
    const auto& pose = graph.map_from_node[prior.node];
    const auto measured = MeasuredNode(prior);
    const auto position_block = prior.information.template topLeftCorner<kDimension, kDimension>();
    const double position_weight = position_block.trace() / kDimension;
    const double rotation_weight = (prior.information.trace() - position_block.trace()) /
                                   static_cast<double>(prior.information.rows() - kDimension);
    alignment.AddPoint(TranslationOf(pose), TranslationOf(measured), position_weight);
    alignment.AddRotation(RotationOf(pose), RotationOf(measured), rotation_weight);
  }
  for (const auto& prior : graph.position_priors) {
    alignments[components.of_node[prior.node]].AddPoint(
        TranslationOf(graph.map_from_node[prior.node]),
        prior.node_in_map,
        prior.information.trace() / kDimension);
  }
  for (const auto& constraint : graph.point_constraints) {
    if (graph.IsPointFixed(constraint.point)) {
      alignments[components.of_node[constraint.from]].AddPoint(
          Apply(graph.map_from_node[constraint.from], constraint.point_in_from),
          graph.points_in_map[constraint.point],
          constraint.information.trace() / kDimension);
    }
  }
  return alignments;
}

// The motion of each component; none for those that have a fixed node or no tie.
template <int kDimension, typename Graph>
auto FindMotions(const Graph& graph, const GraphComponents& components) {
  using Pose = typename decltype(graph.map_from_node)::value_type;
  const std::vector<Alignment<kDimension>> alignments =
      FindAlignments<kDimension>(graph, components);
  std::vector<std::optional<Pose>> motions(components.count);
  for (std::uint32_t i = 0; i < components.count; ++i) {
    typename Alignment<kDimension>::Matrix rotation;
    typename Alignment<kDimension>::Vector translation;
    if (alignments[i].Solve(rotation, translation)) {
      motions[i] = PoseOf(rotation, translation);
    }
  }
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    if (graph.IsFixed(i)) {
      motions[components.of_node[i]].reset();
    }
  }
  return motions;
}

template <int kDimension, typename Graph>
double Align(Graph& graph, const RobustKernel& kernel) {
  if (graph.pose_priors.empty() && graph.position_priors.empty() && graph.fixed_points.empty()) {
    return 0.0;
  }
  const GraphComponents components = FindComponents(graph);
  auto motions = FindMotions<kDimension>(graph, components);
  const auto before_nodes = graph.map_from_node;
  const std::vector<double> before = CostOfTies(graph, components, kernel);
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    if (const auto& motion = motions[components.of_node[i]]; motion.has_value()) {
      graph.map_from_node[i] = *motion * graph.map_from_node[i];
    }
  }
  const std::vector<double> after = CostOfTies(graph, components, kernel);
  double gained = 0.0;
  for (std::uint32_t i = 0; i < components.count; ++i) {
    if (after[i] < before[i]) {
      gained += before[i] - after[i];
    } else {
      motions[i].reset();
    }
  }
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    if (!motions[components.of_node[i]].has_value()) {
      graph.map_from_node[i] = before_nodes[i];
    }
  }
  for (std::size_t i = 0; i < graph.points_in_map.size(); ++i) {
    const auto& motion = motions[components.of_point[i]];
    if (motion.has_value() && !graph.IsPointFixed(i)) {
      graph.points_in_map[i] = Apply(*motion, graph.points_in_map[i]);
    }
  }
  return gained;
}

}  // namespace

double AlignToPriors(PoseGraph& graph, const RobustKernel& kernel) {
  return Align<2>(graph, kernel);
}

double AlignToPriors(SpaceGraph& graph) {
  return Align<3>(graph, RobustKernel{});
}

}  // namespace loci
