// SPDX-License-Identifier: Apache-2.0
// Optimisation from start to finish, and the best of the starts.
#include "core/graph/optimize.h"

#include <string>

#include <gtest/gtest.h>

#include "core/graph/g2o_format.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/datasets.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

TEST(OptimizeTest, ClosesALoopFromOdometry) {
  PoseGraph graph = RandomLoopGraph(61, 200);
  const StatusOr<OptimizationSummary> summary = OptimizeGraph(graph, OptimizeOptions{});
  ASSERT_THAT(summary, IsOk());
  EXPECT_TRUE(summary->converged);
  // 199 + 180 constraints with three numbers each, for 199 free nodes: chi2 is near 3 * 180.
  EXPECT_NEAR(summary->chi2_after, 540.0, 150.0);
  EXPECT_GT(summary->chi2_before, 10.0 * summary->chi2_after);
  EXPECT_EQ(summary->chi2_after, Chi2(graph));
}

TEST(OptimizeTest, SameBitsTwiceAndNothingIsLostByDoingItAgain) {
  PoseGraph graph = RandomLoopGraph(62, 100);
  PoseGraph again = graph;
  ASSERT_THAT(OptimizeGraph(graph, OptimizeOptions{}), IsOk());
  ASSERT_THAT(OptimizeGraph(again, OptimizeOptions{}), IsOk());
  EXPECT_EQ(graph.map_from_node, again.map_from_node);
  const double chi2 = Chi2(graph);
  ASSERT_THAT(OptimizeGraph(again, OptimizeOptions{}), IsOk());
  EXPECT_NEAR(Chi2(again), chi2, 1e-9 * chi2);
}

TEST(OptimizeTest, RefusesAnInvalidGraphAndLeavesIt) {
  PoseGraph graph = RandomLoopGraph(63, 30);
  graph.constraints[3].to = graph.constraints[3].from;
  const PoseGraph before = graph;
  EXPECT_THAT(OptimizeGraph(graph, OptimizeOptions{}),
              IsStatus(StatusCode::kInvalidArgument, "constraints[3]"));
  EXPECT_THAT(OptimizeFromBestStart(graph, SparseOptions{}),
              IsStatus(StatusCode::kInvalidArgument, "constraints[3]"));
  EXPECT_EQ(graph.map_from_node, before.map_from_node);
}

TEST(OptimizeTest, TakesGraphsThatAreHardlyGraphs) {
  PoseGraph graph;
  EXPECT_THAT(OptimizeGraph(graph, OptimizeOptions{}), IsOk());
  EXPECT_THAT(OptimizeFromBestStart(graph, SparseOptions{}), IsOk());
  graph.map_from_node.resize(3);
  graph.points_in_map.resize(1, Eigen::Vector2d::Zero());
  EXPECT_THAT(OptimizeGraph(graph, OptimizeOptions{}), IsOk());
  EXPECT_THAT(OptimizeFromBestStart(graph, SparseOptions{}), IsOk());
}

TEST(OptimizeTest, EveryStartLeadsToTheSameMinimumOfAnEasyGraph) {
  PoseGraph graph = RandomLoopGraph(64, 150);
  AddPoints(65, 30, graph);
  PoseGraph best = graph;
  ASSERT_THAT(OptimizeFromBestStart(best, SparseOptions{}), IsOk());
  for (const GraphStart start :
       {GraphStart::kGiven, GraphStart::kTree, GraphStart::kSwept, GraphStart::kPrefixes}) {
    PoseGraph attempt = graph;
    PlaceAtStart(start, attempt);
    OptimizeSparse(attempt, SparseOptions{});
    EXPECT_NEAR(Chi2(attempt), Chi2(best), 1e-6 * Chi2(best)) << GraphStartName(start);
  }
}

TEST(OptimizeTest, ComponentsAreOptimisedEachForItself) {
  PoseGraph one = RandomLoopGraph(66, 60);
  const PoseGraph other = RandomLoopGraph(67, 60);
  PoseGraph both = one;
  for (const Pose2& pose : other.map_from_node) {
    both.map_from_node.push_back(pose);
  }
  for (GraphConstraint constraint : other.constraints) {
    constraint.from += 60;
    constraint.to += 60;
    both.constraints.push_back(constraint);
  }
  PoseGraph alone = other;
  ASSERT_THAT(OptimizeGraph(one, OptimizeOptions{}), IsOk());
  ASSERT_THAT(OptimizeGraph(alone, OptimizeOptions{}), IsOk());
  ASSERT_THAT(OptimizeGraph(both, OptimizeOptions{}), IsOk());
  EXPECT_NEAR(Chi2(both), Chi2(one) + Chi2(alone), 1e-6 * Chi2(both));
}

struct PublicGraph {
  const char* name;
  double best_chi2;
};

void PrintTo(const PublicGraph& graph, std::ostream* out) {
  *out << graph.name;
}

class PublicGraphTest : public testing::TestWithParam<PublicGraph> {};

TEST_P(PublicGraphTest, ReachesTheBestKnownChi2) {
  LOCI_DATASET_OR_SKIP(text, std::string(GetParam().name));
  StatusOr<G2oGraph> parsed = ParseG2o(text);
  ASSERT_THAT(parsed, IsOk());
  const StatusOr<BestStartSummary> summary = OptimizeFromBestStart(parsed->plane, SparseOptions{});
  ASSERT_THAT(summary, IsOk());
  EXPECT_TRUE(summary->optimization.converged);
  EXPECT_LT(Chi2(parsed->plane), 1.0001 * GetParam().best_chi2);
  EXPECT_GT(Chi2(parsed->plane), 0.999 * GetParam().best_chi2);
}

// From the table of the data sets' page. The last five have local minima at many times the best.
INSTANTIATE_TEST_SUITE_P(All,
                         PublicGraphTest,
                         testing::Values(PublicGraph{"graphs/intel_g2o.g2o.gz", 546.461},
                                         PublicGraph{"graphs/intel.g2o.gz", 45.0047},
                                         PublicGraph{"graphs/CSAIL.g2o.gz", 40.5551},
                                         PublicGraph{"graphs/M3500.g2o.gz", 137.913},
                                         PublicGraph{"graphs/manhattanOlson3500.g2o.gz", 146.077},
                                         PublicGraph{"graphs/city10000.g2o.gz", 511.985},
                                         PublicGraph{"graphs/cityTrees10000.txt.gz", 8668.93},
                                         PublicGraph{"graphs/MIT.g2o.gz", 41.1633},
                                         PublicGraph{"graphs/INTEL_carlone.g2o.gz", 215.837},
                                         PublicGraph{"graphs/M3500a.g2o.gz", 912.115},
                                         PublicGraph{"graphs/victoriaPark.txt.gz", 6184.12},
                                         PublicGraph{"victoria_park/victoriaPark-full.g2o.gz",
                                                     389.787}));

}  // namespace
}  // namespace loci
