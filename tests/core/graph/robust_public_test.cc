// SPDX-License-Identifier: Apache-2.0
// A thousand false closures in a public graph.
#include <cstddef>
#include <cstdint>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

#include "core/graph/g2o_format.h"
#include "core/graph/robust_optimize.h"
#include "core/graph/toro_tree.h"
#include "tests/core/graph/false_closures.h"
#include "tests/support/datasets.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

struct FalseClosuresCase {
  std::string graph;
  double optimum_chi2;  // the best known
  std::uint64_t seed;
  std::size_t run_length;
};

void PrintTo(const FalseClosuresCase& each, std::ostream* out) {
  *out << each.graph << ", seed " << each.seed << ", runs of " << each.run_length;
}

class PublicFalseClosuresTest : public testing::TestWithParam<FalseClosuresCase> {};

TEST_P(PublicFalseClosuresTest, ConsistencyKeepsTheMap) {
  LOCI_DATASET_OR_SKIP(text, "graphs/" + GetParam().graph + ".g2o.gz");
  StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_THAT(parsed, IsOk());
  PoseGraph optimum = parsed->plane;
  MarkClosures(optimum);
  PlaceByTree(BreadthFirstTree(optimum), optimum);
  OptimizeSparse(optimum, SparseOptions{});
  ASSERT_LT(Chi2(optimum), 1.0001 * GetParam().optimum_chi2);
  PoseGraph graph = optimum;
  AddFalseClosures({GetParam().seed, 1000, GetParam().run_length}, graph);
  PlaceByOdometry(graph);
  const StatusOr<RobustSummary> summary = OptimizeRobustly(graph, RobustOptions{});
  ASSERT_THAT(summary, IsOk());
  const RobustScore score = ScoreOf(optimum, graph, summary->accepted.constraints);
  EXPECT_GE(score.precision, 0.99);
  EXPECT_GE(score.recall, 0.95);
  EXPECT_LE(score.rms_m, 0.1);
}

INSTANTIATE_TEST_SUITE_P(Manhattan,
                         PublicFalseClosuresTest,
                         testing::Values(FalseClosuresCase{"manhattanOlson3500", 146.077, 1, 1},
                                         FalseClosuresCase{"manhattanOlson3500", 146.077, 2, 1},
                                         FalseClosuresCase{"manhattanOlson3500", 146.077, 1, 10},
                                         FalseClosuresCase{"manhattanOlson3500", 146.077, 2, 10}));
INSTANTIATE_TEST_SUITE_P(City,
                         PublicFalseClosuresTest,
                         testing::Values(FalseClosuresCase{"city10000", 511.985, 1, 1},
                                         FalseClosuresCase{"city10000", 511.985, 1, 10}));

}  // namespace
}  // namespace loci
