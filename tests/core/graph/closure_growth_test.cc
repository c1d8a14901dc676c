// SPDX-License-Identifier: Apache-2.0
// What growth leaves behind.
#include "core/graph/closure_growth.h"

#include <cstdint>

#include <gtest/gtest.h>

#include "core/graph/graph_selection.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/false_closures.h"
#include "tests/core/graph/random_graph.h"

namespace loci {
namespace {

TEST(ClosureGrowthTest, PosesEndNearTheOptimumOverWhatIsBelieved) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    PoseGraph graph = ManhattanWorld(seed, 600);
    AddFalseClosures({seed + 200, 400, 2}, graph);
    PlaceByOdometry(graph);
    GraphSelection believed = AllOf(graph);
    believed.constraints = GrowByClosures(FindClosureClusters(graph), graph);
    const PoseGraph grown = PartOf(graph, believed);
    PoseGraph optimum = grown;
    OptimizeSparse(optimum, SparseOptions{});
    EXPECT_LT(Chi2(grown), 1.01 * Chi2(optimum)) << "seed " << seed;
  }
}

}  // namespace
}  // namespace loci
