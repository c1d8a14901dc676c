// SPDX-License-Identifier: Apache-2.0
// Ceres as reference and peer for pose graphs: one residual block per constraint, with analytic
// Jacobians, solved by Levenberg-Marquardt over sparse normal equations.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "core/graph/plane_problem.h"
#include "core/graph/pose_graph.h"

namespace loci {

// sqrt(Omega) e over two poses (x, y, theta).
class CeresConstraint final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit CeresConstraint(const GraphConstraint& constraint)
      : constraint_(constraint), root_(constraint.information.llt().matrixU()) {
    constraint_.from = 0;
    constraint_.to = 1;
  }

  bool Evaluate(const double* const* parameters,
                double* residuals,
                double** jacobians) const override {
    pair_.map_from_node = {PoseOf(parameters[0]), PoseOf(parameters[1])};
    const LinearisedPair<3, 3, 3> linearised = Linearised(pair_, constraint_);
    Eigen::Map<Eigen::Vector3d> mapped(residuals);
    mapped = root_ * linearised.error;
    if (jacobians != nullptr) {
      Write(linearised.jacobian_a, pair_.map_from_node[0].theta, jacobians[0]);
      Write(linearised.jacobian_b, pair_.map_from_node[1].theta, jacobians[1]);
    }
    return true;
  }

 private:
  static Pose2 PoseOf(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }

  // Ours is for a shift in the node's frame, Ceres moves x and y in the map.
  void Write(const Eigen::Matrix3d& jacobian, double theta, double* out) const {
    if (out == nullptr) {
      return;
    }
    Eigen::Matrix3d node_from_map = Eigen::Matrix3d::Identity();
    node_from_map.topLeftCorner<2, 2>() << Cos(theta), Sin(theta), -Sin(theta), Cos(theta);
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> mapped(out);
    mapped = root_ * jacobian * node_from_map;
  }

  GraphConstraint constraint_;
  Eigen::Matrix3d root_;
  mutable PoseGraph pair_;  // room for the two poses; Ceres runs on one thread here
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

// Moves the nodes of a graph without points to a local minimum, or until chi2 is at most
// `stop_at_chi2`; returns chi2. No kernel.
inline double SolveByCeres(PoseGraph& graph, double stop_at_chi2) {
  std::vector<std::array<double, 3>> numbers;
  for (const Pose2& pose : graph.map_from_node) {
    numbers.push_back({pose.x, pose.y, pose.theta});
  }
  ceres::Problem problem;
  for (const GraphConstraint& constraint : graph.constraints) {
    problem.AddResidualBlock(new CeresConstraint(constraint),
                             nullptr,
                             numbers[constraint.from].data(),
                             numbers[constraint.to].data());
  }
  const std::vector<bool> held = HeldNodes(graph);
  for (std::size_t i = 0; i < held.size(); ++i) {
    if (held[i] && problem.HasParameterBlock(numbers[i].data())) {
      problem.SetParameterBlockConstant(numbers[i].data());
    }
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.num_threads = 1;
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  StopAtChi2 stop(stop_at_chi2);
  options.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    graph.map_from_node[i] = {numbers[i][0], numbers[i][1], WrapAngle(numbers[i][2])};
  }
  return Chi2(graph);
}

}  // namespace loci
