// SPDX-License-Identifier: Apache-2.0
// The incremental optimiser on public graphs, node by node in the order in which they were
// recorded.
#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "core/graph/g2o_format.h"
#include "core/graph/incremental_optimizer.h"
#include "core/graph/recording_order.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/support/datasets.h"

namespace loci {
namespace {

struct PublicGraph {
  std::string name;
  double at_most;  // of the optimum, at the end
};

class IncrementalPublicTest : public testing::TestWithParam<PublicGraph> {};

// Their constraints' sigmas lie between 0.15 m (Manhattan) and 0.05 mm (INTEL_carlone).
TEST_P(IncrementalPublicTest, EndsNearTheOptimumWhateverItsConstraintsAreWorth) {
  LOCI_DATASET_OR_SKIP(text, "graphs/" + GetParam().name + ".g2o.gz");
  const StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_TRUE(parsed.ok()) << parsed.status().ToString();
  const PoseGraph& whole = parsed->plane;
  const RecordingOrder order(whole);
  IncrementalOptimizer optimizer((IncrementalOptions()));
  for (std::uint32_t node = 0; node < whole.map_from_node.size(); ++node) {
    const Pose2 place =
        order.PlaceOf(node, [&](std::uint32_t other) { return optimizer.map_from_node(other); });
    optimizer.AddNode(place, false);
    for (const std::uint32_t index : order.Constraints(node)) {
      optimizer.AddConstraint(whole.constraints[index]);
    }
    ASSERT_TRUE(optimizer.Update().determined) << node;
  }
  PoseGraph graph = optimizer.Graph();
  const double chi2 = Chi2(graph);
  EXPECT_LE(chi2, GetParam().at_most * OptimizeSparse(graph, SparseOptions{}).chi2_after);
}

INSTANTIATE_TEST_SUITE_P(Graphs,
                         IncrementalPublicTest,
                         testing::Values(PublicGraph{"manhattanOlson3500", 1.0001},
                                         PublicGraph{"M3500", 1.001},
                                         PublicGraph{"M3500a", 1.001},
                                         PublicGraph{"MIT", 1.001},
                                         PublicGraph{"CSAIL", 1.001},
                                         PublicGraph{"intel", 1.001},
                                         PublicGraph{"INTEL_carlone", 1.001}),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace loci
