// SPDX-License-Identifier: Apache-2.0
// Starts, attempts, and their agreement.
#include "core/graph/best_start.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/graph/plane_problem.h"
#include "core/graph/space_problem.h"

namespace loci {
namespace {

// Costs that differ by less than this part of them are one minimum, or one start.
constexpr double kSameCostRelative = 1e-3;
// And so are all that fit as well as this, a part of a constraint's expected chi2.
constexpr double kSameCost = 1e-6;
// A start that is any good is near its minimum after fewer steps than this; the best goes on.
constexpr int kAttemptIterationsMax = 20;
// Near enough to tell minima apart.
constexpr double kAttemptGainMin = 1e-5;
// Runs that end at the lowest minimum before it is believed.
constexpr std::size_t kWitnesses = 2;

bool SameCost(double a, double b) {
  return std::abs(a - b) <= kSameCost + kSameCostRelative * std::max(std::abs(a), std::abs(b));
}

double CostOf(SpaceGraph& graph, const RobustKernel& /*kernel*/) {
  return Chi2(graph);
}

bool IsCheap(GraphStart start) {
  return start != GraphStart::kSwept && start != GraphStart::kPrefixes;
}

template <typename Graph>
class BestStart {
 public:
  BestStart(Graph& graph, const BestStartOptions& options)
      : graph_(graph), given_(graph), options_(options), attempt_options_(options.sparse) {
    attempt_options_.iterations_max =
        std::min(options.sparse.iterations_max, kAttemptIterationsMax);
    attempt_options_.relative_gain_min =
        std::max(options.sparse.relative_gain_min, kAttemptGainMin);
  }

  BestStartSummary Run() {
    const double chi2_before = Chi2(given_);
    const double cost_before = CostOf(given_, options_.sparse.kernel);
    TryCheapStarts();
    for (const GraphStart start : StartsFor(given_)) {
      if (!IsCheap(start) && !IsAgreed()) {
        Try(PlacedAt(start));
      }
    }
    Finish();
    summary_.optimization.chi2_before = chi2_before;
    summary_.optimization.cost_before = cost_before;
    return std::move(summary_);
  }

 private:
  struct Candidate {
    GraphStart start;
    double cost;
    Graph graph;
  };

  double Now() const { return options_.clock_s ? options_.clock_s() : 0.0; }

  Candidate PlacedAt(GraphStart start) {
    const double begin_s = Now();
    Candidate candidate{start, 0.0, given_};
    PlaceAtStart(start, candidate.graph);
    candidate.cost = CostOf(candidate.graph, options_.sparse.kernel);
    summary_.start_s += Now() - begin_s;
    return candidate;
  }

  // Those that are cheap to compute, the lowest cost first.
  void TryCheapStarts() {
    std::vector<Candidate> candidates;
    for (const GraphStart start : StartsFor(given_)) {
      if (IsCheap(start)) {
        candidates.push_back(PlacedAt(start));
      }
    }
    // A cost that is not a number stands last.
    std::stable_sort(
        candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
          return a.cost < b.cost || (std::isnan(b.cost) && !std::isnan(a.cost));
        });
    for (Candidate& candidate : candidates) {
      if (!IsAgreed()) {
        Try(std::move(candidate));
      }
    }
  }

  // Optimises from a start, unless one like it has been tried.
  void Try(Candidate candidate) {
    std::vector<StartAttempt>& attempts = summary_.attempts;
    if (std::any_of(attempts.begin(), attempts.end(), [&](const StartAttempt& attempt) {
          return SameCost(attempt.cost_before, candidate.cost);
        })) {
      return;
    }
    const double begin_s = Now();
    const OptimizationSummary run = OptimizeSparse(candidate.graph, attempt_options_);
    summary_.solve_s += Now() - begin_s;
    if (attempts.empty() || run.cost_after < summary_.optimization.cost_after) {
      summary_.optimization = run;
      summary_.start = candidate.start;
      graph_ = std::move(candidate.graph);
    }
    attempts.push_back(
        {candidate.start, candidate.cost, run.cost_after, run.iterations, run.converged});
  }

  bool IsAgreed() const {
    const auto witnesses = std::count_if(
        summary_.attempts.begin(), summary_.attempts.end(), [&](const StartAttempt& attempt) {
          return attempt.converged &&
                 SameCost(attempt.cost_after, summary_.optimization.cost_after);
        });
    return static_cast<std::size_t>(witnesses) >= kWitnesses;
  }

  // From near the lowest minimum to it.
  void Finish() {
    SparseOptions rest = options_.sparse;
    rest.iterations_max -= summary_.optimization.iterations;
    if (rest.iterations_max <= 0) {
      return;
    }
    const double begin_s = Now();
    const int iterations = summary_.optimization.iterations;
    summary_.optimization = OptimizeSparse(graph_, rest);
    summary_.optimization.iterations += iterations;
    summary_.solve_s += Now() - begin_s;
  }

  Graph& graph_;
  Graph given_;
  const BestStartOptions& options_;
  SparseOptions attempt_options_;
  BestStartSummary summary_;
};

template <typename Graph>
GraphStart PlaceAtLowest(Graph& graph) {
  const Graph given = graph;
  GraphStart best = GraphStart::kGiven;
  double lowest = Chi2(graph);
  for (const GraphStart start : StartsFor(given)) {
    if (!IsCheap(start)) {
      continue;
    }
    Graph placed = given;
    PlaceAtStart(start, placed);
    if (const double chi2 = Chi2(placed); chi2 < lowest || std::isnan(lowest)) {
      lowest = chi2;
      best = start;
      graph = std::move(placed);
    }
  }
  return best;
}

}  // namespace

GraphStart PlaceAtBestStart(PoseGraph& graph) {
  return PlaceAtLowest(graph);
}

GraphStart PlaceAtBestStart(SpaceGraph& graph) {
  return PlaceAtLowest(graph);
}

StatusOr<BestStartSummary> OptimizeFromBestStart(PoseGraph& graph,
                                                 const BestStartOptions& options) {
  LOCI_RETURN_IF_ERROR(ValidateGraph(graph));
  return BestStart<PoseGraph>(graph, options).Run();
}

StatusOr<BestStartSummary> OptimizeFromBestStart(SpaceGraph& graph,
                                                 const BestStartOptions& options) {
  LOCI_RETURN_IF_ERROR(ValidateGraph(graph));
  return BestStart<SpaceGraph>(graph, options).Run();
}

}  // namespace loci
