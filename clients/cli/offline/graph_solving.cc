// SPDX-License-Identifier: Apache-2.0
// Methods and starts by their names.
#include "clients/cli/offline/graph_solving.h"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <type_traits>
#include <utility>

#include "clients/cli/offline/graph_replay.h"
#ifdef LOCI_WITH_CERES
#include "clients/cli/ceres/ceres_optimizer.h"
#endif
#include "core/graph/graph_selection.h"
#include "core/graph/robust_optimize.h"
#include "core/graph/space_problem.h"
#include "core/graph/space_toro.h"
#include "core/graph/sweep_limit.h"
#include "core/graph/toro_optimizer.h"
#include "core/graph/toro_tree.h"

namespace loci::cli {
namespace {

// Valleys with a bent floor need many steps; a step costs milliseconds.
constexpr int kIterationsMax = 1000;
constexpr std::uint64_t kSweepsMax = 1000000;
constexpr std::string_view kAutoStart = "auto";
constexpr std::string_view kCeres = "ceres";

double NowSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

SparseOptions SparseOptionsOf(const SolveRequest& request) {
  SparseOptions options;
  options.iterations_max = kIterationsMax;
  if (request.method == "levenberg-marquardt") {
    options.method = SparseOptions::Method::kLevenbergMarquardt;
  }
  return options;
}

template <typename Graph>
Status CheckSweepable(const Graph& graph) {
  if (IsSweepable(graph)) {
    return {};
  }
  return ResourceExhaustedError("the constraints' paths through the tree have more than " +
                                std::to_string(kPathElementsMax) +
                                " elements: gradient descent does not sweep this graph");
}

// Goes to the start of that name; "auto" is the one with the lowest chi2.
template <typename Graph>
Status GoToStart(const std::string& wanted, Graph& graph, SolveReport& report) {
  const double begin_s = NowSeconds();
  if (wanted == kAutoStart) {
    report.start = GraphStartName(PlaceAtBestStart(graph));
  } else {
    const auto starts = StartsFor(graph);
    const auto found = std::find_if(starts.begin(), starts.end(), [&](GraphStart start) {
      return GraphStartName(start) == wanted;
    });
    if (found == starts.end()) {
      return UnimplementedError("--start " + wanted +
                                ": not for graphs in space (VERTEX_SE3:QUAT)");
    }
    if (*found == GraphStart::kSwept) {
      LOCI_RETURN_IF_ERROR(CheckSweepable(graph));
    }
    PlaceAtStart(*found, graph);
    report.start = wanted;
  }
  report.start_s = NowSeconds() - begin_s;
  report.chi2_start = Chi2(graph);
  return {};
}

template <typename Graph>
StatusOr<SolveReport> SolveFromAllStarts(const SolveRequest& request, Graph& graph) {
  BestStartOptions options;
  options.sparse = SparseOptionsOf(request);
  options.clock_s = NowSeconds;
  LOCI_ASSIGN_OR_RETURN(const BestStartSummary best, OptimizeFromBestStart(graph, options));
  SolveReport report;
  report.summary = best.optimization;
  report.start = GraphStartName(best.start);
  report.attempts = best.attempts;
  report.start_s = best.start_s;
  report.solve_s = best.solve_s;
  for (const StartAttempt& attempt : best.attempts) {
    if (attempt.start == best.start) {
      report.chi2_start = attempt.cost_before;
    }
  }
  return report;
}

template <typename Graph>
StatusOr<OptimizationSummary> OptimizeByMethod(const SolveRequest& request, Graph& graph) {
  if (request.method != kCeres) {
    return OptimizeSparse(graph, SparseOptionsOf(request));
  }
#ifdef LOCI_WITH_CERES
  return OptimizeByCeres(graph, {.iterations_max = kIterationsMax});
#else
  return UnimplementedError(
      "--method ceres: this program is built without Ceres; cmake -DLOCI_WITH_CERES=ON builds one "
      "with it (docs/licences.md), levenberg-marquardt finds the same minimum");
#endif
}

template <typename Graph>
StatusOr<SolveReport> SolveFromOneStart(const SolveRequest& request, Graph& graph) {
  SolveReport report;
  const double chi2_before = Chi2(graph);
  LOCI_RETURN_IF_ERROR(GoToStart(request.start, graph, report));
  const double begin_s = NowSeconds();
  LOCI_ASSIGN_OR_RETURN(report.summary, OptimizeByMethod(request, graph));
  report.solve_s = NowSeconds() - begin_s;
  report.summary.chi2_before = chi2_before;
  return report;
}

// Descent alone. It begins on the tree unless the poses of the file are better, for what it is good
// at is what lies between the tree and the optimum.
template <typename Graph>
StatusOr<SolveReport> SolveByToro(const SolveRequest& request, Graph& graph) {
  using Toro =
      std::conditional_t<std::is_same_v<Graph, PoseGraph>, ToroOptimizer, SpaceToroOptimizer>;
  LOCI_RETURN_IF_ERROR(CheckSweepable(graph));
  if (request.sweeps > kSweepsMax) {
    return InvalidArgumentError("--sweeps: at most " + std::to_string(kSweepsMax));
  }
  SolveReport report;
  const double chi2_before = Chi2(graph);
  std::string start = request.start;
  if (start == kAutoStart) {
    Graph by_tree = graph;
    PlaceAtStart(GraphStart::kTree, by_tree);
    start = GraphStartName(Chi2(by_tree) < chi2_before ? GraphStart::kTree : GraphStart::kGiven);
  }
  LOCI_RETURN_IF_ERROR(GoToStart(start, graph, report));
  const double begin_s = NowSeconds();
  Toro toro(graph);
  for (std::uint64_t i = 0; i < request.sweeps; ++i) {
    toro.Sweep();
  }
  graph.map_from_node = toro.Poses();
  PlacePoints(graph);
  report.solve_s = NowSeconds() - begin_s;
  report.summary.iterations = static_cast<int>(request.sweeps);
  report.summary.chi2_before = chi2_before;
  report.summary.chi2_after = Chi2(graph);
  return report;
}

Status CheckIncremental(const SolveRequest& request) {
  if (request.method != "auto" && request.method != "gauss-newton") {
    return InvalidArgumentError("--incremental: is Gauss-Newton, must not come with --method " +
                                request.method);
  }
  if (request.start != kAutoStart) {
    return InvalidArgumentError(
        "--incremental: places each node as it comes, must not come with --start");
  }
  return {};
}

// What the thresholds of the incremental optimiser leave, a batch finishes.
StatusOr<SolveReport> SolveIncrementally(const SolveRequest& request, PoseGraph& graph) {
  SolveReport report;
  const double chi2_before = Chi2(graph);
  report.start = "incremental";
  LOCI_ASSIGN_OR_RETURN(GraphReplay replay, ReplayGraph(graph, NowSeconds));
  report.start_s = std::accumulate(replay.step_s.begin(), replay.step_s.end(), 0.0);
  report.steps = SummariseSteps(std::move(replay.step_s));
  report.chi2_start = Chi2(graph);
  const double begin_s = NowSeconds();
  report.summary = OptimizeSparse(graph, SparseOptionsOf(request));
  report.solve_s = NowSeconds() - begin_s;
  report.summary.iterations += replay.iterations;
  report.summary.chi2_before = chi2_before;
  return report;
}

StatusOr<SolveReport> SolveIncrementally(const SolveRequest& /*request*/, SpaceGraph& /*graph*/) {
  return UnimplementedError(
      "--incremental: the file has VERTEX_SE3:QUAT; graphs in space are optimised as a whole only");
}

Status CheckRobust(const SolveRequest& request) {
  if (request.incremental) {
    return InvalidArgumentError(
        "--robust: is for graphs as a whole, must not come with --incremental");
  }
  if (request.method == "toro" || request.method == kCeres) {
    return InvalidArgumentError("--robust: is Gauss-Newton, must not come with --method " +
                                request.method);
  }
  if (request.robust == RobustMethodName(RobustMethod::kConsistent) &&
      request.start != kAutoStart) {
    return InvalidArgumentError(
        "--robust consistent: begins at what follows without closures, must not come with --start");
  }
  return {};
}

// Takes the refused closures out of the graph. Points and priors are trusted: none is refused.
ClosureReport RemoveRefused(const GraphSelection& accepted, PoseGraph& graph) {
  ClosureReport report;
  for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
    const GraphConstraint& constraint = graph.constraints[i];
    if (!accepted.constraints[i]) {
      report.refused.push_back({constraint.from, constraint.to, Chi2Of(graph, constraint)});
    } else if (constraint.robust) {
      ++report.accepted_count;
    }
  }
  graph = PartOf(graph, accepted);
  return report;
}

StatusOr<SolveReport> SolveRobustly(const SolveRequest& request, PoseGraph& graph) {
  LOCI_RETURN_IF_ERROR(CheckRobust(request));
  const std::optional<RobustMethod> method = RobustMethodFromName(request.robust);
  if (!method.has_value()) {
    return InvalidArgumentError("--robust: there is no method " + request.robust);
  }
  SolveReport report;
  const double chi2_before = Chi2(graph);
  report.start = GraphStartName(GraphStart::kGiven);
  if (request.start != kAutoStart) {
    LOCI_RETURN_IF_ERROR(GoToStart(request.start, graph, report));
  }
  MarkClosures(graph);
  RobustOptions options;
  options.method = *method;
  options.sparse = SparseOptionsOf(request);
  const double begin_s = NowSeconds();
  LOCI_ASSIGN_OR_RETURN(const RobustSummary summary, OptimizeRobustly(graph, options));
  report.solve_s = NowSeconds() - begin_s;
  report.summary = summary.optimization;
  report.summary.chi2_before = chi2_before;
  report.chi2_start = summary.chi2_start;
  if (summary.began_at_trusted) {
    report.start = "without-closures";
  }
  report.closures = RemoveRefused(summary.accepted, graph);
  return report;
}

StatusOr<SolveReport> SolveRobustly(const SolveRequest& /*request*/, SpaceGraph& /*graph*/) {
  return UnimplementedError("--robust: not for graphs in space (VERTEX_SE3:QUAT)");
}

template <typename Graph>
StatusOr<SolveReport> SolveAny(const SolveRequest& request, Graph& graph) {
  LOCI_RETURN_IF_ERROR(ValidateGraph(graph));
  if (request.robust != RobustMethodName(RobustMethod::kNone)) {
    return SolveRobustly(request, graph);
  }
  if (request.incremental) {
    LOCI_RETURN_IF_ERROR(CheckIncremental(request));
    return SolveIncrementally(request, graph);
  }
  if (request.method == "toro") {
    return SolveByToro(request, graph);
  }
  if (request.method == "auto" && request.start == kAutoStart) {
    return SolveFromAllStarts(request, graph);
  }
  return SolveFromOneStart(request, graph);
}

}  // namespace

std::vector<std::string> SolveMethods() {
  return {"auto", "toro", "gauss-newton", "levenberg-marquardt", std::string(kCeres)};
}

std::vector<std::string> SolveStarts() {
  std::vector<std::string> names = {std::string(kAutoStart)};
  for (const GraphStart start : StartsFor(PoseGraph{})) {
    names.emplace_back(GraphStartName(start));
  }
  return names;
}

std::vector<std::string> SolveRobustMethods() {
  std::vector<std::string> names;
  for (const RobustMethod method : kRobustMethods) {
    names.emplace_back(RobustMethodName(method));
  }
  return names;
}

StepTimes SummariseSteps(std::vector<double> seconds) {
  StepTimes times;
  times.count = seconds.size();
  if (seconds.empty()) {
    return times;
  }
  std::sort(seconds.begin(), seconds.end());
  const auto at = [&](double part) {
    return 1e3 * seconds[static_cast<std::size_t>(part * static_cast<double>(seconds.size() - 1))];
  };
  times.mean_ms = 1e3 * std::accumulate(seconds.begin(), seconds.end(), 0.0) /
                  static_cast<double>(seconds.size());
  times.median_ms = at(0.5);
  times.p95_ms = at(0.95);
  times.max_ms = at(1.0);
  return times;
}

StatusOr<SolveReport> Solve(const SolveRequest& request, PoseGraph& graph) {
  return SolveAny(request, graph);
}

StatusOr<SolveReport> Solve(const SolveRequest& request, SpaceGraph& graph) {
  return SolveAny(request, graph);
}

}  // namespace loci::cli
