// SPDX-License-Identifier: Apache-2.0
// What a place and a closure cost the engine's graph, against one batch optimisation of it.
//
//   map_graph_bench [--tiny]
//
// Public graphs, pose by pose: the constraint to the pose before is the place's tie, all others are
// closures, robust. Processor time of one thread. Closures include the bases that are made of the
// graph after every so many steps.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "bench/interleaved.h"
#include "bench/public_graph.h"
#include "core/engine/map_graph.h"
#include "core/graph/optimize.h"
#include "core/graph/recording_order.h"

namespace loci {
namespace {

void Print(const char* what, std::vector<double> seconds) {
  double total = 0.0;
  for (const double each : seconds) {
    total += each;
  }
  std::sort(seconds.begin(), seconds.end());
  std::printf("  %-8s %6zu: mean %.3f  median %.3f  95 %% %.3f  max %.3f ms\n",
              what,
              seconds.size(),
              1e3 * total / static_cast<double>(seconds.size()),
              1e3 * seconds[seconds.size() / 2],
              1e3 * seconds[seconds.size() * 95 / 100],
              1e3 * seconds.back());
}

// The constraint to the latest node before, which is taken out of the others.
std::optional<GraphConstraint> TakeTie(std::uint32_t node, std::vector<GraphConstraint>& of_node) {
  const auto before = [node](const GraphConstraint& each) {
    return each.from == node ? each.to : each.from;
  };
  const auto tie = std::max_element(
      of_node.begin(), of_node.end(), [&](const GraphConstraint& a, const GraphConstraint& b) {
        return before(a) < before(b);
      });
  if (tie == of_node.end()) {
    return std::nullopt;
  }
  const GraphConstraint taken = *tie;
  of_node.erase(tie);
  return taken;
}

void Measure(const std::string& name, std::uint32_t node_count_max) {
  const std::optional<G2oGraph> read = ReadPublicGraph(name);
  if (!read.has_value()) {
    return;
  }
  const PoseGraph& whole = read->plane;
  const RecordingOrder order(whole);
  MapGraph map;
  std::vector<double> places;
  std::vector<double> closures;
  std::uint32_t closure_count = 0;
  const auto node_count =
      std::min(node_count_max, static_cast<std::uint32_t>(whole.map_from_node.size()));
  for (std::uint32_t node = 0; node < node_count; ++node) {
    std::vector<GraphConstraint> of_node;
    for (const std::uint32_t index : order.Constraints(node)) {
      of_node.push_back(whole.constraints[index]);
    }
    const std::optional<GraphConstraint> tie = TakeTie(node, of_node);
    std::vector<MapConstraint> found;
    for (GraphConstraint& each : of_node) {
      each.robust = true;
      found.push_back({each, ClosureId{closure_count++}});
    }
    const Pose2 at =
        order.PlaceOf(node, [&](std::uint32_t of) { return map.map_from_place(PlaceId{of}); });
    double begin = CpuSeconds();
    map.AddPlace(at, tie);
    places.push_back(CpuSeconds() - begin);
    if (!found.empty()) {
      begin = CpuSeconds();
      map.AddClosures(found);
      closures.push_back(CpuSeconds() - begin);
    }
  }
  PoseGraph graph = map.graph();
  OptimizeOptions options;
  options.sparse.kernel = MapGraph::ClosureKernel();
  const double begin = CpuSeconds();
  const StatusOr<OptimizationSummary> batch = OptimizeGraph(graph, options);
  const double batch_seconds = CpuSeconds() - begin;
  std::printf(
      "%s, %u poses, %u closures, %u bases: one batch %.2f ms lowers the cost to %.6f of it\n",
      name.c_str(),
      node_count,
      closure_count,
      static_cast<unsigned>(map.base_count()),
      1e3 * batch_seconds,
      batch->cost_after / batch->cost_before);
  Print("place", places);
  Print("closures", closures);
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  const bool is_tiny = loci::IsTiny(argc, argv);
  for (const char* name : {"manhattanOlson3500", "city10000"}) {
    loci::Measure(name, is_tiny ? 200 : 0xFFFFFFFFU);
  }
  return 0;
}
