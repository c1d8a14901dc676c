// SPDX-License-Identifier: Apache-2.0
// Analytic Jacobians against automatic differentiation.
#include <array>

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include "core/graph/joint_constraint.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_joint.h"

namespace loci {
namespace {

using Jet = ceres::Jet<double, 9>;  // by three perturbations

struct JetPose {
  Jet x;
  Jet y;
  Jet theta;
};

JetPose operator*(const JetPose& a, const JetPose& b) {
  return {a.x + cos(a.theta) * b.x - sin(a.theta) * b.y,
          a.y + sin(a.theta) * b.x + cos(a.theta) * b.y,
          a.theta + b.theta};
}

JetPose Inverse(const JetPose& a) {
  return {-(cos(a.theta) * a.x + sin(a.theta) * a.y),
          sin(a.theta) * a.x - cos(a.theta) * a.y,
          -a.theta};
}

JetPose Constant(const Pose2& pose) {
  return {Jet(pose.x), Jet(pose.y), Jet(pose.theta)};
}

// The pose with a perturbation on the right, which is 0: to first order Exp is the pose itself.
JetPose Perturbed(const Pose2& pose, int first) {
  return Constant(pose) * JetPose{Jet(0.0, first), Jet(0.0, first + 1), Jet(0.0, first + 2)};
}

TEST(AutomaticJacobianTest, OfConstraintsBetweenManyNodes) {
  RandomSequence random(331);
  for (int trial = 0; trial < 100; ++trial) {
    PoseGraph graph;
    for (int i = 0; i < 3; ++i) {
      graph.map_from_node.push_back(RandomPose(random, 5.0, kPi));
    }
    const JointConstraint constraint = RandomJoint({1, 2, 0}, graph, 2.0, 1.0, random);
    const LinearisedJoint linearised = Linearised(graph, constraint);
    const JetPose first = Perturbed(graph.map_from_node[1], 0);
    for (int i = 0; i < 2; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const JetPose other = Perturbed(graph.map_from_node[constraint.nodes[at + 1]], 3 * i + 3);
      const JetPose error =
          Inverse(Constant(constraint.first_from_node[at])) * (Inverse(first) * other);
      const std::array<Jet, 3> rows{error.x, error.y, error.theta};
      for (int row = 0; row < 3; ++row) {
        const Jet& expected = rows[static_cast<std::size_t>(row)];
        const double difference = expected.a - linearised.error(3 * i + row);
        EXPECT_NEAR(row == 2 ? WrapAngle(difference) : difference, 0.0, 1e-12);
        EXPECT_LT((linearised.jacobian.row(3 * i + row).transpose() - expected.v).norm(), 1e-12);
      }
    }
  }
}

}  // namespace
}  // namespace loci
