// SPDX-License-Identifier: Apache-2.0
// A start for each method, and one finish for all.
#include "core/graph/robust_optimize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/graph/closure_clusters.h"
#include "core/graph/closure_growth.h"
#include "core/graph/graph_selection.h"
#include "core/graph/plane_problem.h"
#include "core/graph/toro_tree.h"

namespace loci {
namespace {

constexpr std::array<std::pair<RobustMethod, std::string_view>, 6> kNames = {{
    {RobustMethod::kNone, "none"},
    {RobustMethod::kHuber, "huber"},
    {RobustMethod::kCauchy, "cauchy"},
    {RobustMethod::kGemanMcClure, "geman-mcclure"},
    {RobustMethod::kDynamicCovariance, "dcs"},
    {RobustMethod::kConsistent, "consistent"},
}};

// 95 % efficient where all errors are normal (Huber 1981; Holland and Welsch 1977).
constexpr double kHuberWidth = 1.345;
constexpr double kCauchyWidth = 2.385;
// Agarwal et al. 2013 use 1 for all their graphs.
constexpr double kDynamicCovarianceWidth = 1.0;
// Of chi2 with two degrees of freedom, where kGateChi2 is that of three.
constexpr double kGateOfTwoChi2 = 13.816;
// Graduated non-convexity: mu falls by this (Yang et al. 2020), with so many steps each.
constexpr double kGraduation = 1.4;
constexpr int kGraduationIterations = 2;
// And from here at most, in 137 of them: a constraint further off than this many gates is wrong.
constexpr double kGraduationStartMax = 1e20;
// What is accepted at an optimum may make another one. After the first of these rounds what was
// refused stays refused, so that constraints that push each other out do not take turns for ever.
constexpr int kFreeSelections = 5;
constexpr int kSelectionsMax = 20;
// The scale of kConsistent is that of loops of a few constraints. At the optimum of a large map
// errors add up that loops do not see.
constexpr double kFinalGateFactor = 2.0;

// Places the points of which only robust constraints speak, each by the first of them.
void PlaceUntrustedPoints(PoseGraph& graph) {
  PoseGraph untrusted = graph;
  untrusted.fixed_points.resize(graph.points_in_map.size());
  untrusted.point_constraints.clear();
  for (const PointConstraint& constraint : graph.point_constraints) {
    if (constraint.robust) {
      untrusted.point_constraints.push_back(constraint);
    } else {
      untrusted.fixed_points[constraint.point] = true;
    }
  }
  PlacePoints(untrusted);
  graph.points_in_map = std::move(untrusted.points_in_map);
}

// Poses from the trusted constraints, and points from the poses.
void PlaceByTrusted(PoseGraph& graph) {
  PoseGraph trusted = PartOf(graph, TrustedOf(graph));
  PlaceByTree(BreadthFirstTree(trusted), trusted);
  TakePoses(std::move(trusted), graph);
  PlaceUntrustedPoints(graph);
}

template <typename Term>
void RaiseToLargestRobust(const PoseGraph& graph, const std::vector<Term>& terms, double& chi2) {
  for (const Term& term : terms) {
    chi2 = std::max(chi2, term.robust ? Chi2Of(graph, term) : 0.0);
  }
}

double LargestRobustChi2(const PoseGraph& graph) {
  double largest = 0.0;
  RaiseToLargestRobust(graph, graph.constraints, largest);
  RaiseToLargestRobust(graph, graph.point_constraints, largest);
  RaiseToLargestRobust(graph, graph.pose_priors, largest);
  RaiseToLargestRobust(graph, graph.position_priors, largest);
  return largest;
}

// Geman and McClure's kernel, from a width at which all is convex down to that of the gate (Yang et
// al. 2020; their weights are the kernel's).
void OptimizeGraduated(SparseOptions options, PoseGraph& graph) {
  OptimizeSparse(graph, options);
  const int iterations_max = options.iterations_max;
  options.kernel.shape = RobustKernel::Shape::kGemanMcClure;
  options.iterations_max = std::min(iterations_max, kGraduationIterations);
  const double largest = LargestRobustChi2(graph);
  // Beyond the range of numbers nothing has a cost, and there is no convex problem to begin with.
  double mu = std::isfinite(largest) ? 2.0 * largest / kGateChi2 : 1.0;
  for (mu = std::min(mu, kGraduationStartMax); mu > 1.0; mu /= kGraduation) {
    options.kernel.width_sigmas = std::sqrt(mu * kGateChi2);
    OptimizeSparse(graph, options);
  }
  options.kernel.width_sigmas = std::sqrt(kGateChi2);
  options.iterations_max = iterations_max;
  OptimizeSparse(graph, options);
}

RobustKernel KernelOf(RobustMethod method) {
  switch (method) {
    case RobustMethod::kHuber:
      return {RobustKernel::Shape::kHuber, kHuberWidth};
    case RobustMethod::kCauchy:
      return {RobustKernel::Shape::kCauchy, kCauchyWidth};
    case RobustMethod::kDynamicCovariance:
      return {RobustKernel::Shape::kDynamicCovariance, kDynamicCovarianceWidth};
    case RobustMethod::kNone:
    case RobustMethod::kGemanMcClure:
    case RobustMethod::kConsistent:
      break;
  }
  return {};
}

// A kernel whose pull falls to 0 lets go of true constraints where the poses are bad, and each set
// of them has a minimum of its own. That of Huber's kernel, which never lets go, is a second start.
void OptimizeFromTwoStarts(const SparseOptions& options, PoseGraph& graph) {
  PoseGraph second = graph;
  SparseOptions huber = options;
  huber.kernel = KernelOf(RobustMethod::kHuber);
  OptimizeSparse(second, huber);
  const OptimizationSummary from_second = OptimizeSparse(second, options);
  const OptimizationSummary from_first = OptimizeSparse(graph, options);
  if (from_second.cost_after < from_first.cost_after) {
    graph = std::move(second);
  }
}

void OptimizeByKernel(RobustMethod method,
                      SparseOptions options,
                      PoseGraph& graph,
                      RobustSummary& summary) {
  options.kernel = KernelOf(method);
  PoseGraph placed = graph;
  PlaceByTrusted(placed);
  summary.began_at_trusted = CostOf(placed, options.kernel) < CostOf(graph, options.kernel);
  if (summary.began_at_trusted) {
    graph = std::move(placed);
  }
  summary.chi2_start = Chi2(graph);
  if (method == RobustMethod::kGemanMcClure) {
    OptimizeGraduated(options, graph);
  } else if (method == RobustMethod::kHuber) {
    OptimizeSparse(graph, options);
  } else {
    OptimizeFromTwoStarts(options, graph);
  }
}

// Which component each node is in, with all fixed nodes in one: they are in one frame already.
std::vector<std::uint32_t> FramesOf(const PoseGraph& graph) {
  const GraphComponents components = FindComponents(graph);
  std::vector<bool> is_fixed(components.count);
  for (std::size_t i = 0; i < components.of_node.size(); ++i) {
    if (graph.IsFixed(i)) {
      is_fixed[components.of_node[i]] = true;
    }
  }
  std::vector<std::uint32_t> frames;
  for (const std::uint32_t component : components.of_node) {
    frames.push_back(is_fixed[component] ? components.count : component);
  }
  return frames;
}

// Returns the frames of the nodes by what is believed; those of different frames are where the
// given poses happened to have them.
std::vector<std::uint32_t> OptimizeByConsistency(const SparseOptions& options,
                                                 PoseGraph& graph,
                                                 RobustSummary& summary) {
  PlaceByTrusted(graph);
  summary.began_at_trusted = true;
  summary.chi2_start = Chi2(graph);
  GraphSelection believed = TrustedOf(graph);
  OptimizePart(believed, options, graph);
  const ClosureClusters clusters = FindClosureClusters(graph);
  believed.constraints = GrowByClosures(clusters, graph);
  GraphSelection with_the_rest = AllOf(graph);
  with_the_rest.constraints = believed.constraints;
  if (believed != with_the_rest) {
    PoseGraph part = PartOf(graph, with_the_rest);
    PlaceUntrustedPoints(part);
    SparseOptions with_kernel = options;
    with_kernel.kernel = {RobustKernel::Shape::kGemanMcClure, std::sqrt(kGateChi2)};
    OptimizeSparse(part, with_kernel);
    TakePoses(std::move(part), graph);
  }
  summary.covariance_scale = clusters.covariance_scale;
  return FramesOf(PartOf(graph, believed));
}

template <typename Term>
std::vector<bool> Passing(const PoseGraph& graph, const std::vector<Term>& terms, double gate) {
  std::vector<bool> passing;
  for (const Term& term : terms) {
    passing.push_back(!term.robust || Chi2Of(graph, term) <= gate);
  }
  return passing;
}

// What passes the gate of its kind. The scale is known of closures only.
GraphSelection Passing(const PoseGraph& graph, double closure_scale) {
  return {Passing(graph, graph.constraints, kGateChi2 * closure_scale),
          Passing(graph, graph.point_constraints, kGateOfTwoChi2),
          Passing(graph, graph.pose_priors, kGateChi2),
          Passing(graph, graph.position_priors, kGateOfTwoChi2)};
}

void KeepCommon(const std::vector<bool>& others, std::vector<bool>& selected) {
  for (std::size_t i = 0; i < selected.size(); ++i) {
    selected[i] = selected[i] && others[i];
  }
}

void KeepCommon(const GraphSelection& others, GraphSelection& selected) {
  KeepCommon(others.constraints, selected.constraints);
  KeepCommon(others.point_constraints, selected.point_constraints);
  KeepCommon(others.pose_priors, selected.pose_priors);
  KeepCommon(others.position_priors, selected.position_priors);
}

// Nothing speaks for a robust constraint between two frames but that the frames happen to fit it.
void RefuseBetweenFrames(const PoseGraph& graph,
                         const std::vector<std::uint32_t>& frames,
                         GraphSelection& selected) {
  for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
    const GraphConstraint& constraint = graph.constraints[i];
    if (constraint.robust && frames[constraint.from] != frames[constraint.to]) {
      selected.constraints[i] = false;
    }
  }
}

// Accepts what passes within its frame, optimises over it, and looks again.
void Select(const SparseOptions& options,
            double closure_scale,
            const std::vector<std::uint32_t>& frames,
            PoseGraph& graph,
            RobustSummary& summary) {
  for (int i = 0; i < kSelectionsMax; ++i) {
    GraphSelection passing = Passing(graph, closure_scale);
    RefuseBetweenFrames(graph, frames, passing);
    if (i >= kFreeSelections) {
      KeepCommon(summary.accepted, passing);
    }
    if (i > 0 && passing == summary.accepted) {
      break;
    }
    summary.accepted = std::move(passing);
    summary.optimization = OptimizePart(summary.accepted, options, graph);
  }
}

}  // namespace

std::string_view RobustMethodName(RobustMethod method) {
  for (const auto& [each, name] : kNames) {
    if (each == method) {
      return name;
    }
  }
  return "none";
}

std::optional<RobustMethod> RobustMethodFromName(std::string_view name) {
  for (const auto& [method, each] : kNames) {
    if (each == name) {
      return method;
    }
  }
  return std::nullopt;
}

void MarkClosures(PoseGraph& graph) {
  for (GraphConstraint& constraint : graph.constraints) {
    const auto [earlier, later] = std::minmax(constraint.from, constraint.to);
    constraint.robust = later - earlier > 1;
  }
}

StatusOr<RobustSummary> OptimizeRobustly(PoseGraph& graph, const RobustOptions& options) {
  LOCI_RETURN_IF_ERROR(ValidateGraph(graph));
  if (options.method == RobustMethod::kConsistent && !graph.joint_constraints.empty()) {
    return FailedPreconditionError(
        "joint_constraints[0]: method consistent knows constraints between two nodes only");
  }
  RobustSummary summary;
  const double chi2_before = Chi2(graph);
  SparseOptions plain = options.sparse;
  plain.kernel = {};
  if (options.method == RobustMethod::kNone) {
    summary.chi2_start = chi2_before;
    summary.accepted = AllOf(graph);
    summary.optimization = OptimizeSparse(graph, plain);
    return summary;
  }
  double closure_scale = 1.0;
  std::vector<std::uint32_t> frames(graph.map_from_node.size());  // kernels know of one only
  if (options.method == RobustMethod::kConsistent) {
    frames = OptimizeByConsistency(plain, graph, summary);
    closure_scale = std::min(1.0, kFinalGateFactor * summary.covariance_scale);
  } else {
    OptimizeByKernel(options.method, plain, graph, summary);
  }
  Select(plain, closure_scale, frames, graph, summary);
  summary.optimization.chi2_before = chi2_before;
  summary.optimization.cost_before = chi2_before;
  return summary;
}

}  // namespace loci
