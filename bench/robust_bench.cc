// SPDX-License-Identifier: Apache-2.0
// Pose graphs with a thousand false closures: which methods keep the map.
//
//   robust_bench [--tiny] [--graph NAME] [--method NAME] [--seed N]
//
// Every method on every graph, with false closures each for itself and in runs of ten that agree
// with each other; or only the graph and the method named. Reads the public graphs
// (tests/support/datasets.h) and skips those that are missing. Kernels on city10000 take minutes.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "bench/interleaved.h"
#include "bench/public_graph.h"
#include "core/graph/robust_optimize.h"
#include "core/graph/toro_tree.h"
#include "tests/core/graph/false_closures.h"

namespace loci {
namespace {

struct Wanted {
  std::string graph;   // empty: all
  std::string method;  // empty: all
  std::uint64_t seed = 1;
};

void Measure(const std::string& name,
             const PoseGraph& optimum,
             const FalseClosureOptions& false_closures,
             RobustMethod method) {
  PoseGraph graph = optimum;
  AddFalseClosures(false_closures, graph);
  PlaceByOdometry(graph);
  RobustOptions options;
  options.method = method;
  const double begin = CpuSeconds();
  const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, options);
  const double seconds = CpuSeconds() - begin;
  if (!summary.ok()) {
    std::printf("%s: %s\n", name.c_str(), summary.status().ToString().c_str());
    return;
  }
  const RobustScore score = ScoreOf(optimum, graph, summary->accepted.constraints);
  std::printf("| %s | %s | %llu | %s | %.4f | %.4f | %.3f m | %.2f s |\n",
              name.c_str(),
              false_closures.run_length == 1 ? "single" : "runs",
              static_cast<unsigned long long>(false_closures.seed),
              std::string(RobustMethodName(method)).c_str(),
              score.precision,
              score.recall,
              score.rms_m,
              seconds);
  std::fflush(stdout);
}

void MeasureAll(const std::string& name,
                PoseGraph graph,
                std::size_t false_count,
                const Wanted& wanted) {
  MarkClosures(graph);
  PlaceByTree(BreadthFirstTree(graph), graph);  // from there the optimum is found
  OptimizeSparse(graph, SparseOptions{});
  for (const std::size_t run_length : {std::size_t{1}, std::size_t{10}}) {
    for (const RobustMethod method : kRobustMethods) {
      if (wanted.method.empty() || wanted.method == RobustMethodName(method)) {
        Measure(name, graph, {wanted.seed, false_count, run_length}, method);
      }
    }
  }
}

void RunAll(const Wanted& wanted) {
  std::printf("| graph | false closures | seed | method | precision | recall | rms | CPU |\n");
  std::printf("|---|---|---|---|---|---|---|---|\n");
  for (const std::string name : {"manhattanOlson3500", "city10000"}) {
    if (!wanted.graph.empty() && wanted.graph != name) {
      continue;
    }
    std::optional<G2oGraph> parsed = ReadPublicGraph(name);
    if (!parsed.has_value()) {
      continue;
    }
    MeasureAll(name, std::move(parsed->plane), 1000, wanted);
  }
}

Wanted WantedOf(int argc, char** argv) {
  Wanted wanted;
  for (int i = 1; i + 1 < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--graph") {
      wanted.graph = argv[++i];
    } else if (word == "--method") {
      wanted.method = argv[++i];
    } else if (word == "--seed") {
      wanted.seed = std::strtoull(argv[++i], nullptr, 10);
    }
  }
  return wanted;
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  if (loci::IsTiny(argc, argv)) {
    loci::MeasureAll("a small town", loci::ManhattanWorld(1, 400), 40, loci::Wanted{});
  } else {
    loci::RunAll(loci::WantedOf(argc, argv));
  }
  return 0;
}
