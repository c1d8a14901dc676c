// SPDX-License-Identifier: Apache-2.0
// Poses and points as Ceres' parameter blocks, and our linearised errors as its cost functions.
#include "clients/cli/ceres/ceres_optimizer.h"

#include <array>
#include <cstddef>
#include <type_traits>
#include <vector>

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "core/base/math.h"
#include "core/geometry/angle.h"
#include "core/graph/gauge.h"
#include "core/graph/plane_problem.h"
#include "core/graph/space_problem.h"

namespace loci {
namespace {

// How a graph's poses are written as numbers for Ceres, which may leave the range of angles.
template <typename Graph>
struct Numbers;

// (x, y, theta)
template <>
struct Numbers<PoseGraph> {
  static constexpr int kOfPose = 3;
  static constexpr int kOfPoint = 2;
  using PoseNumbers = std::array<double, kOfPose>;

  static PoseNumbers Of(const Pose2& pose) { return {pose.x, pose.y, pose.theta}; }
  static Pose2 PoseOf(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }
  static Pose2 Normalised(const Pose2& pose) { return {pose.x, pose.y, WrapAngle(pose.theta)}; }
  static ceres::Manifold* NewManifold() { return nullptr; }

  // The derivative of our right perturbation, a shift in the node's frame, by the numbers.
  static Eigen::Matrix3d PerturbationByNumbers(const Pose2& pose) {
    Eigen::Matrix3d derivative = Eigen::Matrix3d::Identity();
    derivative.topLeftCorner<2, 2>() << Cos(pose.theta), Sin(pose.theta), -Sin(pose.theta),
        Cos(pose.theta);
    return derivative;
  }
};

// (translation, quaternion in Eigen's order x y z w)
template <>
struct Numbers<SpaceGraph> {
  static constexpr int kOfPose = 7;
  static constexpr int kOfPoint = 3;
  using PoseNumbers = std::array<double, kOfPose>;
  using Manifold =
      ceres::ProductManifold<ceres::EuclideanManifold<3>, ceres::EigenQuaternionManifold>;

  static PoseNumbers Of(const Pose3& pose) {
    PoseNumbers numbers;
    Eigen::Map<Eigen::Vector3d>(numbers.data()) = pose.translation;
    Eigen::Map<Eigen::Quaterniond>(numbers.data() + 3) = pose.rotation;
    return numbers;
  }
  static Pose3 PoseOf(const double* numbers) {
    return {Eigen::Map<const Eigen::Vector3d>(numbers),
            Eigen::Map<const Eigen::Quaterniond>(numbers + 3).normalized()};
  }
  static Pose3 Normalised(const Pose3& pose) { return pose; }
  static ceres::Manifold* NewManifold() { return new Manifold; }

  // Of (shift, rotation vector) in the node's frame: the shift is R^T dt, the rotation vector twice
  // the vector part of q^-1 dq.
  static Eigen::Matrix<double, 6, 7> PerturbationByNumbers(const Pose3& pose) {
    const Eigen::Vector3d v = pose.rotation.vec();
    Eigen::Matrix<double, 6, 7> derivative = Eigen::Matrix<double, 6, 7>::Zero();
    derivative.topLeftCorner<3, 3>() = pose.rotation.toRotationMatrix().transpose();
    derivative.block<3, 3>(3, 3) << pose.rotation.w(), v.z(), -v.y(), -v.z(), pose.rotation.w(),
        v.x(), v.y(), -v.x(), pose.rotation.w();
    derivative.block<3, 1>(3, 6) = -v;
    derivative.bottomRows<3>() *= 2.0;
    return derivative;
  }
};

// W with W^T W = information, which may be singular: Cholesky fails then.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> RootOf(const Eigen::Matrix<double, kSize, kSize>& information) {
  using Matrix = Eigen::Matrix<double, kSize, kSize>;
  if (const Eigen::LLT<Matrix> cholesky(information); cholesky.info() == Eigen::Success) {
    return cholesky.matrixU();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(information);
  return solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         solver.eigenvectors().transpose();
}

template <typename Term>
constexpr int kErrorSize = std::remove_cvref_t<decltype(Term::information)>::RowsAtCompileTime;

template <typename Term>
constexpr bool kIsToPoint = requires(const Term& term) {
  term.point;
};

// Writes W J, J by the numbers, if Ceres wants it.
template <typename Jacobian>
void WriteJacobian(const Jacobian& jacobian, double* out) {
  using RowMajor = Eigen::
      Matrix<double, Jacobian::RowsAtCompileTime, Jacobian::ColsAtCompileTime, Eigen::RowMajor>;
  Eigen::Map<RowMajor> mapped(out);
  mapped = jacobian;
}

// W e of a constraint between two poses, or a pose and a point.
template <typename Graph, typename Constraint>
class ConstraintCost final
    : public ceres::SizedCostFunction<kErrorSize<Constraint>,
                                      Numbers<Graph>::kOfPose,
                                      kIsToPoint<Constraint> ? Numbers<Graph>::kOfPoint
                                                             : Numbers<Graph>::kOfPose> {
 public:
  explicit ConstraintCost(const Constraint& constraint)
      : constraint_(constraint), root_(RootOf<kError>(constraint.information)) {
    constraint_.from = 0;
    if constexpr (kIsToPoint<Constraint>) {
      constraint_.point = 0;
      pair_.map_from_node.resize(1);
      pair_.points_in_map.resize(1);
    } else {
      constraint_.to = 1;
      pair_.map_from_node.resize(2);
    }
  }

  bool Evaluate(const double* const* parameters,
                double* residuals,
                double** jacobians) const override {
    pair_.map_from_node[0] = Numbers<Graph>::PoseOf(parameters[0]);
    if constexpr (kIsToPoint<Constraint>) {
      pair_.points_in_map[0] = Eigen::Map<const Point>(parameters[1]);
    } else {
      pair_.map_from_node[1] = Numbers<Graph>::PoseOf(parameters[1]);
    }
    const auto linearised = Linearised(pair_, constraint_);
    Eigen::Map<Eigen::Matrix<double, kError, 1>> mapped(residuals);
    mapped = root_ * linearised.error;
    if (jacobians == nullptr) {
      return true;
    }
    if (jacobians[0] != nullptr) {
      WriteJacobian(OfPose(linearised.jacobian_a, 0), jacobians[0]);
    }
    if (jacobians[1] != nullptr) {
      if constexpr (kIsToPoint<Constraint>) {
        WriteJacobian((root_ * linearised.jacobian_b).eval(), jacobians[1]);
      } else {
        WriteJacobian(OfPose(linearised.jacobian_b, 1), jacobians[1]);
      }
    }
    return true;
  }

 private:
  static constexpr int kError = kErrorSize<Constraint>;
  using Point = Eigen::Matrix<double, Numbers<Graph>::kOfPoint, 1>;

  template <typename Jacobian>
  Eigen::Matrix<double, kError, Numbers<Graph>::kOfPose> OfPose(const Jacobian& jacobian,
                                                                std::size_t node) const {
    return root_ * jacobian * Numbers<Graph>::PerturbationByNumbers(pair_.map_from_node[node]);
  }

  Constraint constraint_;
  Eigen::Matrix<double, kError, kError> root_;
  mutable Graph pair_;  // room for both ends; Ceres runs on one thread here
};

// W e of a prior.
template <typename Graph, typename Prior>
class PriorCost final
    : public ceres::SizedCostFunction<kErrorSize<Prior>, Numbers<Graph>::kOfPose> {
 public:
  explicit PriorCost(const Prior& prior) : prior_(prior), root_(RootOf<kError>(prior.information)) {
    prior_.node = 0;
    alone_.map_from_node.resize(1);
  }

  bool Evaluate(const double* const* parameters,
                double* residuals,
                double** jacobians) const override {
    alone_.map_from_node[0] = Numbers<Graph>::PoseOf(parameters[0]);
    const auto linearised = Linearised(alone_, prior_);
    Eigen::Map<Eigen::Matrix<double, kError, 1>> mapped(residuals);
    mapped = root_ * linearised.error;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      WriteJacobian((root_ * linearised.jacobian *
                     Numbers<Graph>::PerturbationByNumbers(alone_.map_from_node[0]))
                        .eval(),
                    jacobians[0]);
    }
    return true;
  }

 private:
  static constexpr int kError = kErrorSize<Prior>;

  Prior prior_;
  Eigen::Matrix<double, kError, kError> root_;
  mutable Graph alone_;  // room for the node
};

// Ends a solve as soon as chi2 is low enough.
class StopAtChi2 final : public ceres::IterationCallback {
 public:
  explicit StopAtChi2(double chi2) : chi2_(chi2) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    return 2.0 * summary.cost <= chi2_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                       : ceres::SOLVER_CONTINUE;
  }

 private:
  double chi2_;
};

// A graph as Ceres' problem, for one solve.
template <typename Graph>
class CeresProblem {
 public:
  explicit CeresProblem(Graph& graph) : graph_(graph) {
    for (const auto& pose : graph.map_from_node) {
      poses_.push_back(Numbers<Graph>::Of(pose));
    }
    for (const auto& constraint : graph.constraints) {
      problem_.AddResidualBlock(NewCost(constraint),
                                nullptr,
                                poses_[constraint.from].data(),
                                poses_[constraint.to].data());
    }
    for (const auto& constraint : graph.point_constraints) {
      problem_.AddResidualBlock(NewCost(constraint),
                                nullptr,
                                poses_[constraint.from].data(),
                                graph.points_in_map[constraint.point].data());
    }
    AddPriors(graph.pose_priors);
    AddPriors(graph.position_priors);
    HoldWhatIsHeld();
  }

  ceres::Solver::Summary Solve(const CeresOptions& options) {
    ceres::Solver::Options ours;
    ours.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    ours.num_threads = 1;
    ours.max_num_iterations = options.iterations_max;
    ours.function_tolerance = 1e-12;
    ours.parameter_tolerance = 1e-12;
    ours.gradient_tolerance = 1e-12;
    ours.logging_type = ceres::SILENT;
    StopAtChi2 stop(options.stop_at_chi2);
    ours.callbacks.push_back(&stop);
    ceres::Solver::Summary summary;
    ceres::Solve(ours, &problem_, &summary);
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (problem_.HasParameterBlock(poses_[i].data()) &&
          !problem_.IsParameterBlockConstant(poses_[i].data())) {
        graph_.map_from_node[i] =
            Numbers<Graph>::Normalised(Numbers<Graph>::PoseOf(poses_[i].data()));
      }
    }
    return summary;
  }

 private:
  template <typename Constraint>
  static ceres::CostFunction* NewCost(const Constraint& constraint) {
    return new ConstraintCost<Graph, Constraint>(constraint);
  }

  template <typename Prior>
  void AddPriors(const std::vector<Prior>& priors) {
    for (const Prior& prior : priors) {
      problem_.AddResidualBlock(
          new PriorCost<Graph, Prior>(prior), nullptr, poses_[prior.node].data());
    }
  }

  // Damping takes care of directions that priors leave open.
  void HoldWhatIsHeld() {
    const std::vector<bool> held = FindGauge(graph_).held;
    for (std::size_t i = 0; i < held.size(); ++i) {
      if (!problem_.HasParameterBlock(poses_[i].data())) {
        continue;
      }
      if (ceres::Manifold* manifold = Numbers<Graph>::NewManifold(); manifold != nullptr) {
        problem_.SetManifold(poses_[i].data(), manifold);
      }
      if (held[i]) {
        problem_.SetParameterBlockConstant(poses_[i].data());
      }
    }
    for (std::size_t i = 0; i < graph_.points_in_map.size(); ++i) {
      double* point = graph_.points_in_map[i].data();
      if (graph_.IsPointFixed(i) && problem_.HasParameterBlock(point)) {
        problem_.SetParameterBlockConstant(point);
      }
    }
  }

  Graph& graph_;  // whose points Ceres moves where they are
  std::vector<typename Numbers<Graph>::PoseNumbers> poses_;
  ceres::Problem problem_;
};

template <typename Graph>
OptimizationSummary Optimize(Graph& graph, const CeresOptions& options) {
  OptimizationSummary summary;
  summary.chi2_before = Chi2(graph);
  summary.cost_before = summary.chi2_before;
  const ceres::Solver::Summary solved = CeresProblem<Graph>(graph).Solve(options);
  // The first one is the state before all steps; there is none if nothing is free.
  summary.iterations = std::max(0, static_cast<int>(solved.iterations.size()) - 1);
  summary.converged = solved.termination_type == ceres::CONVERGENCE ||
                      solved.termination_type == ceres::USER_SUCCESS;
  summary.chi2_after = Chi2(graph);
  summary.cost_after = summary.chi2_after;
  return summary;
}

}  // namespace

OptimizationSummary OptimizeByCeres(PoseGraph& graph, const CeresOptions& options) {
  return Optimize(graph, options);
}

OptimizationSummary OptimizeByCeres(SpaceGraph& graph, const CeresOptions& options) {
  return Optimize(graph, options);
}

}  // namespace loci
