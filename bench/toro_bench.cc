// SPDX-License-Identifier: Apache-2.0
// Gradient descent on the tree of a pose graph: whole sweeps, and a graph that grows pose by pose.
//
//   toro_bench [--tiny]
//
// Processor time of one thread. Sweeps: median of five runs from the breadth-first tree; setting up
// is the first sweep with all that comes before it. Growing: everything that one pose costs, and at
// 20 checkpoints the ratio of chi2 to the optimum of what is there so far. Reads the public graphs
// (tests/support/datasets.h) and skips those that are missing.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/contestants.h"
#include "bench/interleaved.h"
#include "bench/public_graph.h"
#include "core/graph/recording_order.h"
#include "core/graph/space_problem.h"
#include "core/graph/space_toro.h"
#include "core/graph/sparse_optimizer.h"
#include "core/graph/toro_optimizer.h"
#include "core/graph/toro_paths.h"
#include "core/graph/toro_tree.h"
#include "tests/core/graph/growing_graph.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_space_graph.h"

namespace loci {
namespace {

constexpr std::size_t kCheckpoints = 20;

// Elements of all constraints' paths in the tree: what one sweep goes over.
template <typename Graph>
std::size_t PathElements(const Graph& graph, const ToroTree& tree) {
  std::size_t count = 0;
  ToroPath path;
  for (const auto& constraint : graph.constraints) {
    FindToroPath(
        {constraint.from, constraint.to},
        [&](std::uint32_t node) { return tree.parent[node]; },
        [&](std::uint32_t node) { return tree.depth[node]; },
        path);
    count += path.from_half.size() + path.to_half.size();
  }
  return count;
}

// From the tree and from `near`: the lower of both minima.
template <typename Graph>
double OptimumOf(Graph near) {
  Graph by_tree = near;
  PlaceByTree(BreadthFirstTree(near), by_tree);
  return std::min(OptimizeSparse(near, SparseOptions{}).chi2_after,
                  OptimizeSparse(by_tree, SparseOptions{}).chi2_after);
}

template <typename Toro, typename Graph>
void MeasureSweeps(const std::string& name, Graph graph, int sweeps, int rounds) {
  const ToroTree tree = BreadthFirstTree(graph);
  PlaceByTree(tree, graph);
  const double before = Chi2(graph);
  std::vector<double> set_up_s;
  std::vector<double> sweep_s;
  Graph swept = graph;
  for (int round = 0; round < rounds; ++round) {
    const double begin = ThreadSeconds();
    Toro toro(graph);
    toro.Sweep();
    const double middle = ThreadSeconds();
    for (int i = 1; i < sweeps; ++i) {
      toro.Sweep();
    }
    sweep_s.push_back((ThreadSeconds() - middle) / (sweeps - 1));
    set_up_s.push_back(middle - begin);
    swept.map_from_node = toro.Poses();
  }
  const std::size_t elements = PathElements(graph, tree);
  const double chi2 = Chi2(swept);
  std::printf(
      "%s, sweeps: set up %.2f ms, %.3f ms a sweep, %zu path elements, %.1f ns each   "
      "chi2 %.6g -> %.6g after %d, %.3f of the optimum\n",
      name.c_str(),
      1e3 * MedianOf(set_up_s),
      1e3 * MedianOf(sweep_s),
      elements,
      1e9 * MedianOf(sweep_s) / static_cast<double>(elements),
      before,
      chi2,
      sweeps,
      chi2 / OptimumOf(swept));
}

void PrintTimes(const std::string& name, std::vector<double> seconds) {
  const std::size_t count = seconds.size();
  const double total = std::accumulate(seconds.begin(), seconds.end(), 0.0);
  std::sort(seconds.begin(), seconds.end());
  std::printf("%s, growing: total %.3f s   mean %.3f  median %.4f  95 %% %.3f  max %.3f ms\n",
              name.c_str(),
              total,
              1e3 * total / static_cast<double>(count),
              1e3 * seconds[count / 2],
              1e3 * seconds[count * 95 / 100],
              1e3 * seconds.back());
}

void MeasureGrowing(const std::string& name, const PoseGraph& whole) {
  const RecordingOrder recorded(whole);
  const std::size_t count = whole.map_from_node.size();
  ToroOptimizer toro((PoseGraph()));
  std::vector<double> seconds;
  std::vector<std::pair<std::size_t, double>> ratios;  // at so many nodes
  for (std::uint32_t node = 0; node < count; ++node) {
    const double begin = ThreadSeconds();
    toro.AddNode(whole.map_from_node[node], false);
    for (const std::uint32_t constraint : recorded.Constraints(node)) {
      toro.AddConstraint(whole.constraints[constraint]);
    }
    toro.Update();
    seconds.push_back(ThreadSeconds() - begin);
    if ((node + 1) * kCheckpoints % count < kCheckpoints) {
      PoseGraph prefix = PrefixOf(whole, node + 1);
      prefix.map_from_node = toro.Poses();
      ratios.emplace_back(node + 1, Chi2(prefix) / OptimumOf(prefix));
    }
  }
  PrintTimes(name, seconds);
  std::printf("%s, chi2 over the optimum at so many nodes:", name.c_str());
  for (const auto& [nodes, ratio] : ratios) {
    std::printf("  %zu %.3f", nodes, ratio);
  }
  std::printf("\n");
}

void RunTiny() {
  const PoseGraph graph = RandomManhattanGraph(1, 200);
  MeasureSweeps<ToroOptimizer>("random town", graph, 3, 1);
  MeasureSweeps<SpaceToroOptimizer>("random rings in space", RandomSpaceLoops(1, 100), 3, 1);
  MeasureGrowing("random town", graph);
}

void RunAll() {
  for (const std::string name :
       {"manhattanOlson3500", "city10000", "sphere2500", "parking-garage"}) {
    const std::optional<G2oGraph> parsed = ReadPublicGraph(name);
    if (!parsed.has_value()) {
      continue;
    }
    if (parsed->in_space()) {
      MeasureSweeps<SpaceToroOptimizer>(name, parsed->space, 50, 5);
    } else {
      MeasureSweeps<ToroOptimizer>(name, parsed->plane, 50, 5);
      MeasureGrowing(name, parsed->plane);
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
