// SPDX-License-Identifier: Apache-2.0
// Rank of what ties a component to the map, and ties for the rest.
#include "core/graph/gauge.h"

#include <cstddef>

#include <Eigen/Eigenvalues>

#include "core/graph/linearised_prior.h"
#include "core/graph/plane_problem.h"
#include "core/graph/space_problem.h"

namespace loci {
namespace {

// A direction counts as open below this part of the best determined one: far above rounding, and
// far below what two fixes at a centimetre from each other say about a turn.
constexpr double kOpenRelative = 1e-9;

// What is known of the rigid motion of one component, as a right perturbation of `node`.
template <int kSize>
struct ComponentTie {
  using Matrix = Eigen::Matrix<double, kSize, kSize>;

  bool has_fixed_node = false;
  bool has_term = false;
  std::uint32_t node = 0;
  Matrix information = Matrix::Zero();
};

// Adds up what each absolute term says about the motion of its node's component.
template <typename Graph, int kSize>
class GaugeFinder {
 public:
  using Matrix = Eigen::Matrix<double, kSize, kSize>;

  explicit GaugeFinder(const Graph& graph)
      : graph_(graph), components_(FindComponents(graph)), ties_(components_.count) {
    gauge_.held.resize(graph.map_from_node.size());
    for (std::size_t i = 0; i < gauge_.held.size(); ++i) {
      gauge_.held[i] = graph.IsFixed(i);
      Of(i).has_fixed_node = Of(i).has_fixed_node || gauge_.held[i];
    }
  }

  // A term whose error depends on `node` by `jacobian`.
  template <int kError>
  void Add(std::uint32_t node,
           const Eigen::Matrix<double, kError, kSize>& jacobian,
           const Eigen::Matrix<double, kError, kError>& information) {
    ComponentTie<kSize>& tie = Of(node);
    if (!tie.has_term) {
      tie.has_term = true;
      tie.node = node;
    }
    const Eigen::Matrix<double, kError, kSize> by_motion =
        jacobian * Adjoint(Inverse(graph_.map_from_node[node]) * graph_.map_from_node[tie.node]);
    tie.information += by_motion.transpose() * information * by_motion;
  }

  Gauge<kSize> Take() && {
    for (std::size_t i = 0; i < gauge_.held.size(); ++i) {
      ComponentTie<kSize>& tie = Of(i);
      if (tie.has_fixed_node) {
        continue;
      }
      tie.has_fixed_node = true;  // once per component
      const Matrix open = OpenDirections(tie.information);
      if (tie.information.isZero(0.0)) {
        gauge_.held[i] = true;
      } else if (!open.isZero(0.0)) {
        gauge_.ties.push_back({tie.node, open});
      }
    }
    return std::move(gauge_);
  }

 private:
  ComponentTie<kSize>& Of(std::size_t node) { return ties_[components_.of_node[node]]; }

  // As strong as the best determined direction, in those that are open.
  static Matrix OpenDirections(const Matrix& information) {
    const Eigen::SelfAdjointEigenSolver<Matrix> solver(information);
    const double largest = solver.eigenvalues()(kSize - 1);
    Matrix open = Matrix::Zero();
    for (int i = 0; i < kSize; ++i) {
      if (solver.eigenvalues()(i) <= kOpenRelative * largest) {
        open += largest * solver.eigenvectors().col(i) * solver.eigenvectors().col(i).transpose();
      }
    }
    return open;
  }

  const Graph& graph_;
  GraphComponents components_;
  std::vector<ComponentTie<kSize>> ties_;
  Gauge<kSize> gauge_;
};

// Priors, and constraints to points that are fixed.
template <int kSize, typename Graph>
Gauge<kSize> FindGaugeOf(const Graph& graph) {
  GaugeFinder<Graph, kSize> finder(graph);
  for (const auto& prior : graph.pose_priors) {
    finder.Add(prior.node, Linearised(graph, prior).jacobian, prior.information);
  }
  for (const auto& prior : graph.position_priors) {
    finder.Add(prior.node, Linearised(graph, prior).jacobian, prior.information);
  }
  for (const auto& constraint : graph.point_constraints) {
    if (graph.IsPointFixed(constraint.point)) {
      finder.Add(constraint.from, Linearised(graph, constraint).jacobian_a, constraint.information);
    }
  }
  return std::move(finder).Take();
}

}  // namespace

Gauge<3> FindGauge(const PoseGraph& graph) {
  return FindGaugeOf<3>(graph);
}

Gauge<6> FindGauge(const SpaceGraph& graph) {
  return FindGaugeOf<6>(graph);
}

std::vector<bool> HeldNodes(const PoseGraph& graph) {
  return FindGauge(graph).held;
}

}  // namespace loci
