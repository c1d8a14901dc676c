// SPDX-License-Identifier: Apache-2.0
// The starts by name.
#include "core/graph/graph_start.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "core/base/check.h"
#include "core/graph/align_to_priors.h"
#include "core/graph/chordal_start.h"
#include "core/graph/joint_constraint.h"
#include "core/graph/prefix_start.h"
#include "core/graph/space_toro.h"
#include "core/graph/spanning_tree.h"
#include "core/graph/sweep_limit.h"
#include "core/graph/toro_optimizer.h"
#include "core/graph/toro_tree.h"

namespace loci {
namespace {

// Ten sweeps take most of what descent can take; Gauss-Newton is cheaper from there.
constexpr int kSweeps = 10;
// As many optimisations of prefixes as this, at least 50 nodes apart.
constexpr std::size_t kPrefixes = 40;
constexpr std::size_t kPrefixNodesMin = 50;

constexpr std::array<GraphStart, 7> kStarts = {GraphStart::kGiven,
                                               GraphStart::kOdometry,
                                               GraphStart::kTree,
                                               GraphStart::kUncertaintyTree,
                                               GraphStart::kChordal,
                                               GraphStart::kSwept,
                                               GraphStart::kPrefixes};
constexpr std::size_t kStartsInSpace = 6;

template <typename Toro, typename Graph>
void PlaceBySweeps(Graph& graph) {
  PlaceByTree(BreadthFirstTree(graph), graph);
  if (!IsSweepable(graph)) {
    return;
  }
  Toro toro(graph);
  for (int i = 0; i < kSweeps; ++i) {
    toro.Sweep();
  }
  graph.map_from_node = toro.Poses();
  PlacePoints(graph);
}

}  // namespace

std::string_view GraphStartName(GraphStart start) {
  switch (start) {
    case GraphStart::kGiven:
      return "file";
    case GraphStart::kOdometry:
      return "odometry";
    case GraphStart::kTree:
      return "tree";
    case GraphStart::kUncertaintyTree:
      return "uncertainty-tree";
    case GraphStart::kChordal:
      return "chordal";
    case GraphStart::kSwept:
      return "swept";
    case GraphStart::kPrefixes:
      return "prefixes";
  }
  return "file";
}

std::span<const GraphStart> StartsFor(const PoseGraph& /*graph*/) {
  return kStarts;
}

std::span<const GraphStart> StartsFor(const SpaceGraph& /*graph*/) {
  return std::span(kStarts).first(kStartsInSpace);
}

void PlaceAtStart(GraphStart start, PoseGraph& graph) {
  if (!graph.joint_constraints.empty()) {
    PoseGraph pairs = WithImpliedPairs(graph);
    PlaceAtStart(start, pairs);
    graph.map_from_node = std::move(pairs.map_from_node);
    graph.points_in_map = std::move(pairs.points_in_map);
    return;
  }
  switch (start) {
    case GraphStart::kGiven:
      return;
    case GraphStart::kOdometry:
      PlaceByTree(MinimumSpanningTree(graph, StepCosts(graph)), graph);
      break;
    case GraphStart::kTree:
      PlaceByTree(BreadthFirstTree(graph), graph);
      break;
    case GraphStart::kUncertaintyTree:
      PlaceByTree(ShortestPathTree(graph, UncertaintyCosts(graph)), graph);
      break;
    case GraphStart::kChordal:
      PlaceByChords(graph);
      break;
    case GraphStart::kSwept:
      PlaceBySweeps<ToroOptimizer>(graph);
      break;
    case GraphStart::kPrefixes:
      PlaceByPrefixes(std::max(kPrefixNodesMin, graph.map_from_node.size() / kPrefixes), graph);
      break;
  }
  AlignToPriors(graph, RobustKernel{});
}

void PlaceAtStart(GraphStart start, SpaceGraph& graph) {
  const PoseGraph topology = TopologyOf(graph);
  switch (start) {
    case GraphStart::kGiven:
      return;
    case GraphStart::kOdometry:
      PlaceByTree(MinimumSpanningTree(topology, StepCosts(topology)), graph);
      break;
    case GraphStart::kTree:
      PlaceByTree(BreadthFirstTree(graph), graph);
      break;
    case GraphStart::kUncertaintyTree:
      PlaceByTree(ShortestPathTree(topology, UncertaintyCosts(graph)), graph);
      break;
    case GraphStart::kChordal:
      PlaceByChords(graph);
      break;
    case GraphStart::kSwept:
      PlaceBySweeps<SpaceToroOptimizer>(graph);
      break;
    case GraphStart::kPrefixes:
      LOCI_CHECK(false);
  }
  AlignToPriors(graph);
}

}  // namespace loci
