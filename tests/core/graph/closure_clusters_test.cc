// SPDX-License-Identifier: Apache-2.0
// Loops of two closures, and the clusters made of them.
#include "core/graph/closure_clusters.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "core/graph/graph_selection.h"
#include "tests/core/graph/false_closures.h"
#include "tests/core/graph/random_graph.h"

namespace loci {
namespace {

Eigen::Matrix3d SmallCovariance() {
  return Eigen::Vector3d(1e-4, 4e-4, 1e-6).asDiagonal();
}

TEST(ClosureClustersTest, TheErrorOfALoopHasTheCovarianceThatIsStated) {
  // Closures, and the ways between their ends, with errors from their covariances: chi2 has three
  // degrees of freedom.
  RandomSequence random(41);
  const Pose2 a_side = RandomPose(random, 2.0, 1.0);
  const Pose2 b_side = RandomPose(random, 2.0, 1.0);
  const Pose2 first_a_from_b = RandomPose(random, 4.0, kPi);
  const Pose2 second_a_from_b = Inverse(a_side) * first_a_from_b * b_side;
  const auto noisy = [&](const Pose2& pose) {
    return pose * Pose2{1e-2 * random.NextNormal(),
                        2e-2 * random.NextNormal(),
                        1e-3 * random.NextNormal()};
  };
  double sum = 0.0;
  constexpr int kTrials = 2000;
  for (int i = 0; i < kTrials; ++i) {
    sum += CompareClosures({0, 0, 1, noisy(first_a_from_b), SmallCovariance()},
                           {1, 2, 3, noisy(second_a_from_b), SmallCovariance()},
                           {noisy(a_side), SmallCovariance()},
                           {noisy(b_side), SmallCovariance()})
               .chi2;
  }
  EXPECT_NEAR(sum / kTrials, 3.0, 0.2);
}

TEST(ClosureClustersTest, APredictionIsHeldAgainstBothCovariances) {
  const Pose2 a_from_b{1.0, 2.0, 0.5};
  const Closure closure{0, 0, 1, a_from_b * Pose2{0.03, 0.0, 0.0}, SmallCovariance()};
  const Discrepancy discrepancy = CompareClosure(closure, {a_from_b, 3.0 * SmallCovariance()});
  EXPECT_NEAR(discrepancy.chi2, 0.03 * 0.03 / 4e-4, 1e-9);
  EXPECT_NEAR(discrepancy.sigma_product, 8.0 * 1e-2 * 2e-2 * 1e-3, 1e-12);
}

TEST(ClosureClustersTest, AClosureSaysTheSameWhicheverWayItIsWritten) {
  PoseGraph graph = ManhattanWorld(42, 300);
  PoseGraph turned = graph;
  for (GraphConstraint& constraint : turned.constraints) {
    if (constraint.robust) {
      // Covariance and information of the inverse.
      const Eigen::Matrix3d adjoint = Adjoint(Inverse(constraint.from_from_to));
      constraint.information = (adjoint.transpose() * constraint.information * adjoint).eval();
      constraint.from_from_to = Inverse(constraint.from_from_to);
      std::swap(constraint.from, constraint.to);
    }
  }
  const std::vector<Closure> expected = ClosuresOf(graph);
  const std::vector<Closure> closures = ClosuresOf(turned);
  ASSERT_EQ(closures.size(), expected.size());
  ASSERT_GT(closures.size(), 10U);
  for (std::size_t i = 0; i < closures.size(); ++i) {
    EXPECT_EQ(closures[i].a, expected[i].a);
    EXPECT_EQ(closures[i].b, expected[i].b);
    EXPECT_LT(closures[i].a, closures[i].b);
    EXPECT_LT((closures[i].a_from_b.vector() - expected[i].a_from_b.vector()).norm(), 1e-12);
    EXPECT_LT((closures[i].covariance - expected[i].covariance).norm(),
              1e-9 * expected[i].covariance.norm());
  }
  EXPECT_EQ(FindClosureClusters(turned).clusters, FindClosureClusters(graph).clusters);
}

TEST(ClosureClustersTest, FindsHowMuchTooLargeTheCovariancesAre) {
  PoseGraph graph = ManhattanWorld(43, 1000);
  EXPECT_GT(FindClosureClusters(graph).covariance_scale, 0.7);
  for (GraphConstraint& constraint : graph.constraints) {
    constraint.information *= 0.02;
  }
  // Twice what it is: the margin.
  EXPECT_NEAR(FindClosureClusters(graph).covariance_scale, 0.04, 0.015);
}

TEST(ClosureClustersTest, TrueClosuresHangTogetherAndFalseOnesStandAlone) {
  PoseGraph graph = ManhattanWorld(44, 1000);
  const std::size_t true_count = graph.constraints.size();
  AddFalseClosures({45, 200, 1}, graph);
  const ClosureClusters found = FindClosureClusters(graph);
  std::set<std::uint32_t> seen;
  std::size_t together = 0;
  std::size_t mixed = 0;
  for (const std::vector<std::uint32_t>& cluster : found.clusters) {
    const auto false_count =
        std::count_if(cluster.begin(), cluster.end(), [&](std::uint32_t closure) {
          return found.closures[closure].constraint >= true_count;
        });
    seen.insert(cluster.begin(), cluster.end());
    together += cluster.size() > 1 ? cluster.size() : 0;
    mixed += false_count > 0 && cluster.size() > 1 ? 1U : 0U;
  }
  EXPECT_EQ(seen.size(), found.closures.size());  // each closure is in one cluster
  EXPECT_GT(together, (found.closures.size() - 200) * 9 / 10);
  EXPECT_LE(mixed, 2U);
}

TEST(ClosureClustersTest, TheAreaIsThatOfMostPositionsHoweverFarTheOthersAre) {
  std::vector<Eigen::Vector2d> positions;
  for (int i = 0; i <= 200; ++i) {
    positions.emplace_back(0.1 * i, 0.05 * (i * 7 % 201));
  }
  EXPECT_NEAR(AreaOf(positions), 200.0, 1e-9);
  for (int i = 0; i < 10; ++i) {
    positions.emplace_back(1e6, -1e9);
  }
  EXPECT_NEAR(AreaOf(positions), 200.0, 30.0);
  EXPECT_EQ(AreaOf({}), 1.0);
  EXPECT_EQ(AreaOf({{5.0, 5.0}}), 1.0);
  EXPECT_NEAR(AreaOf({{0.0, 0.0}, {3.0, 4.0}}), 12.0, 1e-12);
}

TEST(ClosureClustersTest, MeasurementsBeyondTheRangeOfNumbersFitNothing) {
  const Relation near{Pose2{1.0, 0.0, 0.5}, SmallCovariance()};
  const Closure closure{0, 0, 1, Pose2{1e200, 0.0, 0.5}, SmallCovariance()};
  EXPECT_FALSE(CompareClosure(closure, near).chi2 < 1e300);
  EXPECT_FALSE(std::isnan(CompareClosure(closure, near).chi2));
  EXPECT_FALSE(std::isnan(CompareClosures(closure, closure, near, near).chi2));
}

// Each is compared with a few of the others, and looks at few: all would take far longer.
TEST(ClosureClustersTest, ManyCopiesOfOneClosureAreOneCluster) {
  constexpr std::size_t kCopies = 10000;
  PoseGraph graph = ManhattanWorld(46, 100);
  graph = PartOf(graph, TrustedOf(graph));
  const Pose2 from_from_to = Inverse(graph.map_from_node[10]) * graph.map_from_node[80];
  graph.constraints.insert(graph.constraints.end(),
                           kCopies,
                           {10, 80, from_from_to, 1e4 * Eigen::Matrix3d::Identity(), true});
  const ClosureClusters found = FindClosureClusters(graph);
  ASSERT_EQ(found.clusters.size(), 1U);
  EXPECT_EQ(found.clusters[0].size(), kCopies);
}

}  // namespace
}  // namespace loci
