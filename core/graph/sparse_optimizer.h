// SPDX-License-Identifier: Apache-2.0
// Sparse Gauss-Newton with a Levenberg-Marquardt fallback, and covariances from the factor.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/base/status.h"
#include "core/graph/least_squares.h"
#include "core/graph/pose_graph.h"
#include "core/graph/robust_kernel.h"

namespace loci {

struct SparseOptions {
  enum class Method : std::uint8_t {
    kGaussNewton,         // undamped steps; damped ones from the first step that makes it worse
    kLevenbergMarquardt,  // damped from the start
  };
  Method method = Method::kGaussNewton;
  // First turns all nodes to headings that agree, and moves them to where they then belong
  // (PlaneProblem::TurnToAgree, PlaceToAgree; the latter counts as a step), which spares steps from
  // far away. Taken back where it leads to a higher cost than that of the start. For graphs in the
  // plane without points or joint constraints; others are optimised as if it were not set.
  bool turn_first = false;
  int iterations_max = 100;
  // Converged when a step gains less than this part of the cost, or moves nothing by more than
  // `step_min` (m, rad).
  double relative_gain_min = 1e-10;
  double step_min = 1e-10;
  RobustKernel kernel;  // for constraints marked robust
};

// What the minimiser takes of them.
LeastSquaresOptions LeastSquaresOptionsFrom(const SparseOptions& options);

struct OptimizationSummary {
  int iterations = 0;        // steps that were taken
  double chi2_before = 0.0;  // sum of e^T Omega e, without kernel; as Chi2(), up to rounding
  double chi2_after = 0.0;
  double cost_before = 0.0;  // sum of rho(e^T Omega e): what is minimised
  double cost_after = 0.0;
  bool converged = false;
};

// Moves free nodes and points to a local minimum of the cost; never to a higher cost. The same bits
// for the same graph on the same machine. `graph` must be valid (ValidateGraph).
OptimizationSummary OptimizeSparse(PoseGraph& graph, const SparseOptions& options);

// Covariances of nodes, from the factor of the normal equations at the graph's present poses.
//
// Order (x, y, theta), right perturbation: map_from_node * Exp(xi). Held nodes have covariance 0.
// Keeps no reference to the graph. Not thread-safe: it remembers what it has solved. A pair costs
// what stands above it in the elimination tree, not the size of the graph.
class GraphCovariance {
 public:
  // kFailedPrecondition if the equations are singular: a node is not tied in all its directions.
  static StatusOr<GraphCovariance> Compute(const PoseGraph& graph, const RobustKernel& kernel);
  ~GraphCovariance();
  GraphCovariance(GraphCovariance&&) noexcept;
  GraphCovariance& operator=(GraphCovariance&&) noexcept;

  // Of map_from_node, relative to what holds its component or ties it to the map (gauge.h).
  Eigen::Matrix3d Marginal(std::uint32_t node);
  // Of from_from_to = Inverse(map_from_from) * map_from_to, as from_from_to * Exp(xi). For nodes of
  // two components the answer says nothing about their relation, since both are held.
  Eigen::Matrix3d Relative(std::uint32_t from, std::uint32_t to);
  // Of all these nodes' map_from_node together, three rows and columns each, in their order.
  Eigen::MatrixXd Joint(std::span<const std::uint32_t> nodes);

 private:
  struct Factor;
  explicit GraphCovariance(std::unique_ptr<Factor> factor);
  std::unique_ptr<Factor> factor_;
};

}  // namespace loci
