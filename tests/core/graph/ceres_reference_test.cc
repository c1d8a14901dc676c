// SPDX-License-Identifier: Apache-2.0
// Our optimum is Ceres' optimum.
#include <gtest/gtest.h>

#include "core/graph/g2o_format.h"
#include "core/graph/optimize.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/ceres_graph.h"
#include "tests/support/datasets.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

void ExpectSameOptimum(const PoseGraph& graph) {
  PoseGraph ours = graph;
  PoseGraph theirs = graph;
  ASSERT_THAT(OptimizeGraph(ours, OptimizeOptions{}), IsOk());
  const double chi2 = SolveByCeres(theirs, /*stop_at_chi2=*/0.0);
  EXPECT_NEAR(Chi2(ours), chi2, 1e-6 * chi2);
  for (std::size_t i = 0; i < graph.map_from_node.size(); ++i) {
    EXPECT_LT((Inverse(ours.map_from_node[i]) * theirs.map_from_node[i]).vector().norm(), 1e-3)
        << "node " << i;
  }
}

TEST(CeresReferenceTest, FindsTheSameOptimumOfRandomGraphs) {
  for (const std::uint64_t seed : {71U, 72U, 73U}) {
    PoseGraph graph = RandomLoopGraph(seed, 100);
    RandomSequence random(seed);
    for (GraphConstraint& constraint : graph.constraints) {
      constraint.information = 50.0 * RandomInformation(random);
    }
    ExpectSameOptimum(graph);
  }
}

TEST(CeresReferenceTest, FindsTheSameOptimumOfIntel) {
  LOCI_DATASET_OR_SKIP(text, "graphs/intel_g2o.g2o.gz");
  const StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_THAT(parsed, IsOk());
  ExpectSameOptimum(parsed->plane);
}

}  // namespace
}  // namespace loci
