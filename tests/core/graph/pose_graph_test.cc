// SPDX-License-Identifier: Apache-2.0
// chi2, validity, order and components of pose graphs.
#include "core/graph/pose_graph.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include <gtest/gtest.h>

#include "core/graph/robust_kernel.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

PoseGraph TwoNodes() {
  PoseGraph graph;
  graph.map_from_node = {Pose2{1.0, 2.0, 0.5 * kPi}, Pose2{1.0, 5.0, kPi}};
  GraphConstraint constraint;
  constraint.from = 0;
  constraint.to = 1;
  constraint.from_from_to = {2.0, 0.0, 0.5 * kPi};
  constraint.information.diagonal() << 4.0, 1.0, 1.0;
  graph.constraints = {constraint};
  return graph;
}

TEST(PoseGraphTest, ErrorIsThePredictedPoseSeenFromTheMeasuredOne) {
  const PoseGraph graph = TwoNodes();
  // Predicted: 3 m ahead, turned left. Measured: 2 m ahead, turned left. The metre that is left
  // over points to the right of the measured frame.
  const Eigen::Vector3d error = ErrorOf(graph, graph.constraints[0]);
  EXPECT_NEAR(error.x(), 0.0, 1e-12);
  EXPECT_NEAR(error.y(), -1.0, 1e-12);
  EXPECT_NEAR(error.z(), 0.0, 1e-12);
  EXPECT_NEAR(Chi2(graph), 1.0, 1e-12);
}

TEST(PoseGraphTest, AnglesJustBeyondPiAreSmallErrors) {
  PoseGraph graph = TwoNodes();
  graph.map_from_node = {Pose2{}, Pose2{2.0, 0.0, -kPi + 0.001}};
  graph.constraints[0].from_from_to = {2.0, 0.0, kPi - 0.001};
  EXPECT_NEAR(ErrorOf(graph, graph.constraints[0]).z(), 0.002, 1e-12);
}

TEST(PoseGraphTest, Chi2StaysWhenEverythingMovesRigidly) {
  PoseGraph graph = RandomLoopGraph(1, 60);
  AddPoints(2, 10, graph);
  AddPriors(7, graph);
  const double chi2 = Chi2(graph);
  ASSERT_GT(chi2, 100.0);
  RandomSequence random(3);
  for (int i = 0; i < 20; ++i) {
    EXPECT_NEAR(Chi2(Moved(RandomPose(random, 1000.0, kPi), graph)), chi2, 1e-7 * chi2);
  }
}

TEST(PoseGraphTest, RefusesWhatIsNoGraphAndSaysWhichConstraint) {
  const PoseGraph good = TwoNodes();
  EXPECT_THAT(ValidateGraph(good), IsOk());
  const auto status_with = [&](auto change) {
    PoseGraph graph = good;
    change(graph);
    return ValidateGraph(graph);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(status_with([](PoseGraph& g) { g.constraints[0].to = 0; }),
              IsStatus(StatusCode::kInvalidArgument, "constraints[0]: joins node 0 to itself"));
  EXPECT_THAT(status_with([](PoseGraph& g) { g.constraints[0].to = 2; }),
              IsStatus(StatusCode::kInvalidArgument, "constraints[0].to: 2, must be < 2"));
  EXPECT_THAT(status_with([&](PoseGraph& g) { g.constraints[0].from_from_to.x = nan; }),
              IsStatus(StatusCode::kInvalidArgument, "constraints[0].from_from_to"));
  EXPECT_THAT(status_with([&](PoseGraph& g) { g.map_from_node[1].theta = nan; }),
              IsStatus(StatusCode::kInvalidArgument, "map_from_node[1]"));
  EXPECT_THAT(status_with([](PoseGraph& g) { g.constraints[0].information(2, 2) = -1.0; }),
              IsStatus(StatusCode::kInvalidArgument, "information: eigenvalue -1"));
  EXPECT_THAT(status_with([](PoseGraph& g) { g.constraints[0].information(0, 2) = 0.5; }),
              IsStatus(StatusCode::kInvalidArgument, "information: not symmetric"));
  EXPECT_THAT(status_with([](PoseGraph& g) { g.constraints[0].information.setZero(); }), IsOk());
  EXPECT_THAT(status_with([](PoseGraph& g) { g.point_constraints.resize(1); }),
              IsStatus(StatusCode::kInvalidArgument, "point_constraints[0].point"));
  EXPECT_THAT(status_with([](PoseGraph& g) { g.pose_priors.push_back({.node = 2}); }),
              IsStatus(StatusCode::kInvalidArgument, "pose_priors[0].node: 2, must be < 2"));
  EXPECT_THAT(status_with([&](PoseGraph& g) {
                g.pose_priors.push_back({.node = 1, .map_from_node = {0.0, nan, 0.0}});
              }),
              IsStatus(StatusCode::kInvalidArgument, "pose_priors[0].map_from_node"));
  EXPECT_THAT(status_with([](PoseGraph& g) {
                g.pose_priors.push_back({.information = -Eigen::Matrix3d::Identity()});
              }),
              IsStatus(StatusCode::kInvalidArgument, "pose_priors[0].information: eigenvalue -1"));
  EXPECT_THAT(status_with([](PoseGraph& g) { g.position_priors.push_back({.node = 9}); }),
              IsStatus(StatusCode::kInvalidArgument, "position_priors[0].node: 9, must be < 2"));
  EXPECT_THAT(status_with([&](PoseGraph& g) {
                g.position_priors.push_back({.node_in_map = {nan, 0.0}});
              }),
              IsStatus(StatusCode::kInvalidArgument, "position_priors[0].node_in_map"));
  EXPECT_THAT(status_with([](PoseGraph& g) {
                g.position_priors.push_back({.information = -Eigen::Matrix2d::Identity()});
              }),
              IsStatus(StatusCode::kInvalidArgument, "position_priors[0].information"));
}

TEST(PoseGraphTest, CountsInformationThatIsZero) {
  PoseGraph graph = TwoNodes();
  EXPECT_EQ(CountZeroInformation(graph), 0U);
  graph.constraints[0].information.setZero();
  graph.pose_priors.push_back({.information = Eigen::Matrix3d::Zero()});
  graph.position_priors.push_back({.information = Eigen::Matrix2d::Zero()});
  graph.position_priors.push_back({});
  EXPECT_EQ(CountZeroInformation(graph), 3U);
}

TEST(PoseGraphTest, SortingMakesEveryPermutationTheSame) {
  PoseGraph graph = RandomLoopGraph(4, 50);
  AddPoints(5, 10, graph);
  graph.constraints.push_back(
      graph.constraints[7]);  // duplicates, and others that differ in one bit
  graph.constraints.push_back(graph.constraints[7]);
  graph.constraints.back().robust = true;
  AddPriors(8, graph);
  PoseGraph shuffled = graph;
  RandomSequence random(6);
  for (std::size_t i = shuffled.constraints.size() - 1; i > 0; --i) {
    std::swap(shuffled.constraints[i], shuffled.constraints[random.NextBits() % (i + 1)]);
  }
  std::reverse(shuffled.point_constraints.begin(), shuffled.point_constraints.end());
  std::reverse(shuffled.pose_priors.begin(), shuffled.pose_priors.end());
  std::reverse(shuffled.position_priors.begin(), shuffled.position_priors.end());
  SortConstraints(graph);
  SortConstraints(shuffled);
  const auto same = [](const GraphConstraint& a, const GraphConstraint& b) {
    return std::tie(a.from, a.to, a.from_from_to, a.robust) ==
               std::tie(b.from, b.to, b.from_from_to, b.robust) &&
           a.information == b.information;
  };
  EXPECT_TRUE(std::equal(graph.constraints.begin(),
                         graph.constraints.end(),
                         shuffled.constraints.begin(),
                         shuffled.constraints.end(),
                         same));
  EXPECT_EQ(Chi2(graph), Chi2(shuffled));
}

TEST(PoseGraphTest, ComponentsAreNumberedByTheirLowestNode) {
  PoseGraph graph;
  graph.map_from_node.resize(5);
  graph.points_in_map.resize(2);
  graph.constraints.resize(2);
  graph.constraints[0].from = 4;
  graph.constraints[0].to = 2;
  graph.constraints[1].from = 0;
  graph.constraints[1].to = 3;
  graph.point_constraints.resize(1);
  graph.point_constraints[0].from = 1;
  const GraphComponents components = FindComponents(graph);
  EXPECT_EQ(components.of_node, (std::vector<std::uint32_t>{0, 1, 2, 0, 2}));
  EXPECT_EQ(components.of_point, (std::vector<std::uint32_t>{1, 3}));
  EXPECT_EQ(components.count, 4U);
  graph.fixed = {false, false, false, false, true};
  EXPECT_EQ(HeldNodes(graph), (std::vector<bool>{true, true, false, false, true}));
}

TEST(RobustKernelTest, WeightIsTheDerivativeOfRho) {
  for (const RobustKernel::Shape shape : {RobustKernel::Shape::kNone,
                                          RobustKernel::Shape::kHuber,
                                          RobustKernel::Shape::kCauchy,
                                          RobustKernel::Shape::kGemanMcClure,
                                          RobustKernel::Shape::kDynamicCovariance}) {
    const RobustKernel kernel{shape, 2.0};
    EXPECT_EQ(kernel.Rho(0.0), 0.0);
    EXPECT_EQ(kernel.Weight(0.0), 1.0);
    for (const double chi2 : {0.1, 1.0, 3.9, 4.1, 30.0, 1000.0}) {
      const double h = 1e-5 * chi2;
      EXPECT_NEAR(
          (kernel.Rho(chi2 + h) - kernel.Rho(chi2 - h)) / (2.0 * h), kernel.Weight(chi2), 1e-8);
      EXPECT_LE(kernel.Rho(chi2), chi2);
    }
  }
}

}  // namespace
}  // namespace loci
