// SPDX-License-Identifier: Apache-2.0
// Gauss-Newton over the plane problem, and covariances from its factor.
#include "core/graph/sparse_optimizer.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/base/check.h"
#include "core/graph/align_to_priors.h"
#include "core/graph/least_squares.h"
#include "core/graph/plane_problem.h"
#include "core/graph/relative_covariance.h"

namespace loci {

LeastSquaresOptions LeastSquaresOptionsFrom(const SparseOptions& options) {
  return {.damped_from_start = options.method == SparseOptions::Method::kLevenbergMarquardt,
          .iterations_max = options.iterations_max,
          .relative_gain_min = options.relative_gain_min,
          .step_min = options.step_min};
}

namespace {

// Begins with headings and positions that agree.
LeastSquaresSummary MinimiseTurnedFirst(PlaneProblem& problem,
                                        NormalEquations& equations,
                                        LeastSquaresOptions options) {
  int steps = 0;
  if (options.iterations_max > 0 && problem.PlaceToAgree(equations)) {
    steps = 1;
    --options.iterations_max;
  }
  LeastSquaresSummary summary = Minimise(problem, equations, options);
  summary.iterations += steps;
  return summary;
}

LeastSquaresSummary Minimise(PlaneProblem& problem, const SparseOptions& sparse_options) {
  const LeastSquaresOptions options = LeastSquaresOptionsFrom(sparse_options);
  NormalEquations equations(problem.BlockSizes(), problem.Pairs(), problem.Groups());
  int iterations_taken_back = 0;
  if (sparse_options.turn_first) {
    const PlaneProblem::State start = problem.Save();
    const double cost_before = problem.Cost();
    if (problem.TurnToAgree(equations)) {
      LeastSquaresSummary summary = MinimiseTurnedFirst(problem, equations, options);
      if (summary.cost_after <= cost_before) {
        summary.cost_before = cost_before;
        return summary;
      }
      problem.Restore(start);
      iterations_taken_back = summary.iterations;
    }
  }
  LeastSquaresSummary summary = Minimise(problem, equations, options);
  summary.iterations += iterations_taken_back;
  return summary;
}

}  // namespace

OptimizationSummary OptimizeSparse(PoseGraph& graph, const SparseOptions& options) {
  // Without a kernel, the cost is chi2.
  const bool has_kernel = options.kernel.shape != RobustKernel::Shape::kNone;
  const double chi2_before = has_kernel ? Chi2(graph) : 0.0;
  const double gained = AlignToPriors(graph, options.kernel);
  PlaneProblem problem(graph, options.kernel);
  const LeastSquaresSummary minimised = Minimise(problem, options);
  OptimizationSummary summary;
  summary.iterations = minimised.iterations;
  summary.cost_before = minimised.cost_before + gained;
  summary.cost_after = minimised.cost_after;
  summary.chi2_before = has_kernel ? chi2_before : summary.cost_before;
  summary.chi2_after = has_kernel ? Chi2(graph) : summary.cost_after;
  summary.converged = minimised.converged;
  return summary;
}

struct GraphCovariance::Factor {
  Factor(const PoseGraph& present, const RobustKernel& kernel)
      : graph(present),
        problem(graph, kernel),
        equations(problem.BlockSizes(), problem.Pairs(), problem.Groups()) {}

  bool IsHeld(std::uint32_t node) const { return problem.BlockOfNode(node) == kHeldBlock; }

  Eigen::Matrix3d Diagonal(std::uint32_t node) {
    if (IsHeld(node)) {
      return Eigen::Matrix3d::Zero();
    }
    const auto [found, is_new] = diagonal.try_emplace(node);
    if (is_new) {
      const std::uint32_t block = problem.BlockOfNode(node);
      found->second = equations.InverseBlock(block, block);
    }
    return found->second;
  }

  // Of a row and a column node. Always taken from the columns of the larger index: the two ways to
  // the same block differ in the last bit.
  Eigen::Matrix3d Cross(std::uint32_t row, std::uint32_t column) {
    if (IsHeld(row) || IsHeld(column)) {
      return Eigen::Matrix3d::Zero();
    }
    const Eigen::Matrix3d block = equations.InverseBlock(
        problem.BlockOfNode(std::min(row, column)), problem.BlockOfNode(std::max(row, column)));
    if (row < column) {
      return block;
    }
    return block.transpose();
  }

  PoseGraph graph;
  PlaneProblem problem;
  NormalEquations equations;
  std::map<std::uint32_t, Eigen::Matrix3d> diagonal;  // of the inverse, by node, as far as solved
};

GraphCovariance::GraphCovariance(std::unique_ptr<Factor> factor) : factor_(std::move(factor)) {}
GraphCovariance::~GraphCovariance() = default;
GraphCovariance::GraphCovariance(GraphCovariance&&) noexcept = default;
GraphCovariance& GraphCovariance::operator=(GraphCovariance&&) noexcept = default;

StatusOr<GraphCovariance> GraphCovariance::Compute(const PoseGraph& graph,
                                                   const RobustKernel& kernel) {
  auto factor = std::make_unique<Factor>(graph, kernel);
  factor->equations.Clear();
  factor->problem.Linearise(factor->equations);
  if (!factor->equations.Factor(/*damping=*/0.0)) {
    return FailedPreconditionError(
        "graph: its information is singular; every node must be tied in x, y and theta");
  }
  return GraphCovariance(std::move(factor));
}

Eigen::Matrix3d GraphCovariance::Marginal(std::uint32_t node) {
  LOCI_CHECK(node < factor_->graph.map_from_node.size());
  const Eigen::Matrix3d block = factor_->Diagonal(node);
  return 0.5 * (block + block.transpose());
}

Eigen::Matrix3d GraphCovariance::Relative(std::uint32_t from, std::uint32_t to) {
  const std::vector<Pose2>& map_from_node = factor_->graph.map_from_node;
  LOCI_CHECK(from < map_from_node.size() && to < map_from_node.size());
  return RelativeCovarianceOf(
      from,
      to,
      Inverse(map_from_node[to]) * map_from_node[from],
      kHeldBlock,
      [&](std::uint32_t node) { return factor_->problem.BlockOfNode(node); },
      [&](std::span<const std::uint32_t> blocks, const Eigen::MatrixXd& a) {
        return factor_->equations.InverseForm(blocks, a);
      });
}

Eigen::MatrixXd GraphCovariance::Joint(std::span<const std::uint32_t> nodes) {
  const auto size = 3 * static_cast<Eigen::Index>(nodes.size());
  Eigen::MatrixXd joint(size, size);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    LOCI_CHECK(nodes[i] < factor_->graph.map_from_node.size());
    const auto row = 3 * static_cast<Eigen::Index>(i);
    for (std::size_t j = 0; j < i; ++j) {
      const auto column = 3 * static_cast<Eigen::Index>(j);
      const Eigen::Matrix3d block =
          nodes[i] == nodes[j] ? Marginal(nodes[i]) : factor_->Cross(nodes[i], nodes[j]);
      joint.block<3, 3>(row, column) = block;
      joint.block<3, 3>(column, row) = block.transpose();
    }
    joint.block<3, 3>(row, row) = Marginal(nodes[i]);
  }
  return joint;
}

}  // namespace loci
