// SPDX-License-Identifier: Apache-2.0
// A pose graph that grows pose by pose, at its optimum after each.
//
//   incremental_bench [--tiny]
//
// Processor time of one thread per pose: mean, median, 95 %, 99 % and largest, beside the time that
// Ceres takes for one batch solve of the whole graph in the same run (from odometry, or from the
// tree). At 20 checkpoints the result is held against the batch optimum of what is there so far.
// Reads the public graphs (tests/support/datasets.h) and skips those that are missing.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/contestants.h"
#include "bench/interleaved.h"
#include "bench/public_graph.h"
#include "core/graph/graph_start.h"
#include "core/graph/incremental_optimizer.h"
#include "core/graph/recording_order.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/random_graph.h"
#ifdef LOCI_HAVE_CERES
#include "clients/cli/ceres/ceres_optimizer.h"
#endif

namespace loci {
namespace {

constexpr double kNear = 1.001;
constexpr std::size_t kCheckpoints = 20;

void Measure(const std::string& name, const PoseGraph& whole) {
  const RecordingOrder order(whole);
  IncrementalOptimizer optimizer((IncrementalOptions()));
  std::vector<double> seconds;
  double worst = 1.0;
  const std::size_t count = whole.map_from_node.size();
  for (std::uint32_t node = 0; node < count; ++node) {
    const double begin = ThreadSeconds();
    const Pose2 place =
        order.PlaceOf(node, [&](std::uint32_t other) { return optimizer.map_from_node(other); });
    optimizer.AddNode(place, false);
    for (const std::uint32_t index : order.Constraints(node)) {
      optimizer.AddConstraint(whole.constraints[index]);
    }
    optimizer.Update();
    seconds.push_back(ThreadSeconds() - begin);
    if ((node + 1) * kCheckpoints % count < kCheckpoints && node + 1 < count) {
      PoseGraph graph = optimizer.Graph();
      const double chi2 = Chi2(graph);
      worst = std::max(worst, chi2 / OptimizeSparse(graph, SparseOptions{}).chi2_after);
    }
  }
  PoseGraph last = optimizer.Graph();
  const double chi2 = Chi2(last);
  const double optimum = OptimizeSparse(last, SparseOptions{}).chi2_after;
  double total = 0.0;
  for (const double each : seconds) {
    total += each;
  }
  std::sort(seconds.begin(), seconds.end());
  const auto quantile = [&](std::size_t percent) {
    return 1e3 * seconds[std::min(count - 1, count * percent / 100)];
  };
  std::printf(
      "%-24s total %7.3f s   mean %.3f  median %.3f  95 %% %.3f  99 %% %.3f  max %.3f ms   "
      "chi2 %.6g, %.5f of the optimum; worst prefix %.5f\n",
      name.c_str(),
      total,
      1e3 * total / static_cast<double>(count),
      quantile(50),
      quantile(95),
      quantile(99),
      quantile(100),
      chi2,
      chi2 / optimum,
      worst);
#ifdef LOCI_HAVE_CERES
  std::vector<double> ceres;
  for (int round = 0; round < 5; ++round) {
    PoseGraph graph = whole;
    const double begin = ThreadSeconds();
    OptimizeByCeres(graph, {.stop_at_chi2 = kNear * optimum});
    ceres.push_back(ThreadSeconds() - begin);
  }
  std::sort(ceres.begin(), ceres.end());
  std::printf(
      "%-24s one batch solve by Ceres %.1f ms: total / that %.2f, 95 %% / that %.4f, "
      "max / that %.4f\n",
      name.c_str(),
      1e3 * ceres[2],
      total / ceres[2],
      1e-3 * quantile(95) / ceres[2],
      1e-3 * quantile(100) / ceres[2]);
#endif
}

void RunAll() {
  for (const auto& [name, start] :
       {std::pair<std::string, GraphStart>{"manhattanOlson3500", GraphStart::kOdometry},
        {"city10000", GraphStart::kTree}}) {
    std::optional<G2oGraph> parsed = ReadPublicGraph(name);
    if (!parsed.has_value()) {
      continue;
    }
    PlaceAtStart(start, parsed->plane);
    Measure(name, parsed->plane);
  }
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  if (loci::IsTiny(argc, argv)) {
    loci::Measure("random loops", loci::RandomLoopGraph(1, 200));
  } else {
    loci::RunAll();
  }
  return 0;
}
