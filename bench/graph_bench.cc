// SPDX-License-Identifier: Apache-2.0
// Pose graphs: batch optimisation against Ceres.
//
//   graph_bench [--tiny]
//
// Processor time of one thread until chi2 is within 0.1 % of the optimum, both from the same start,
// in turn, median of five. Reads the public graphs (tests/support/datasets.h) and skips those that
// are missing.
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "bench/contestants.h"
#include "bench/interleaved.h"
#include "bench/public_graph.h"
#include "core/graph/graph_start.h"
#include "core/graph/space_problem.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/random_graph.h"
#ifdef LOCI_HAVE_CERES
#include "clients/cli/ceres/ceres_optimizer.h"
#endif

namespace loci {
namespace {

constexpr double kNear = 1.001;

struct Case {
  std::string name;
  GraphStart start;
  bool turn_first = false;  // SparseOptions; it pays far from the optimum
};

// The fewest steps after which ours is near the optimum.
template <typename Graph>
int StepsToOptimum(const Graph& start, SparseOptions options, double optimum) {
  for (options.iterations_max = 1; options.iterations_max < 100; ++options.iterations_max) {
    Graph graph = start;
    if (OptimizeSparse(graph, options).chi2_after <= kNear * optimum) {
      break;
    }
  }
  return options.iterations_max;
}

template <typename Graph>
void MeasureBatch(const std::string& name, const Graph& start, bool turn_first, int rounds) {
  Graph best = start;
  const double optimum = OptimizeSparse(best, SparseOptions{}).chi2_after;
  SparseOptions options;
  options.turn_first = turn_first;
  options.iterations_max = StepsToOptimum(start, options, optimum);
  const auto ours = [&] {
    Graph graph = start;
    OptimizeSparse(graph, options);
  };
#ifdef LOCI_HAVE_CERES
  const InterleavedTimes times = MeasureInterleaved(rounds, ours, [&] {
    Graph graph = start;
    OptimizeByCeres(graph, {.stop_at_chi2 = kNear * optimum});
  });
  std::printf("%-46s %9.2f ms (%d steps)   Ceres %9.2f ms   ours / Ceres %.3f   chi2 %.6g\n",
              name.c_str(),
              1e3 * times.ours_s,
              options.iterations_max,
              1e3 * times.theirs_s,
              1.0 / times.ratio,
              optimum);
#else
  const InterleavedTimes times = MeasureInterleaved(rounds, ours, [] {});
  std::printf("%-46s %9.2f ms (%d steps)   Ceres is missing   chi2 %.6g\n",
              name.c_str(),
              1e3 * times.ours_s,
              options.iterations_max,
              optimum);
#endif
}

void RunTiny() {
  MeasureBatch("random loops, given", RandomLoopGraph(1, 200), true, 1);
}

void RunAll() {
  for (const Case& each : {Case{"manhattanOlson3500", GraphStart::kOdometry, true},
                           Case{"MIT", GraphStart::kTree, true},
                           Case{"city10000", GraphStart::kTree, true},
                           Case{"intel_g2o", GraphStart::kGiven},
                           Case{"parking-garage", GraphStart::kGiven},
                           Case{"sphere2500", GraphStart::kGiven}}) {
    std::optional<G2oGraph> parsed = ReadPublicGraph(each.name);
    if (!parsed.has_value()) {
      continue;
    }
    const auto measure = [&](auto& graph) {
      PlaceAtStart(each.start, graph);
      MeasureBatch(each.name + ", " + std::string(GraphStartName(each.start)) +
                       (each.turn_first ? ", headings first" : ""),
                   graph,
                   each.turn_first,
                   5);
    };
    if (parsed->in_space()) {
      measure(parsed->space);
    } else {
      measure(parsed->plane);
    }
  }
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  if (loci::IsTiny(argc, argv)) {
    loci::RunTiny();
  } else {
    loci::RunAll();
  }
  return 0;
}
