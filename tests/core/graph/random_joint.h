// SPDX-License-Identifier: Apache-2.0
// Random joint constraints for tests.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "tests/core/graph/random_graph.h"

namespace loci {

// About where the nodes are, with a dense information of full rank.
inline JointConstraint RandomJoint(std::vector<std::uint32_t> nodes,
                                   const PoseGraph& graph,
                                   double range_m,
                                   double range_rad,
                                   RandomSequence& random) {
  JointConstraint constraint;
  constraint.nodes = std::move(nodes);
  const auto size = 3 * static_cast<Eigen::Index>(constraint.nodes.size() - 1);
  const Eigen::MatrixXd root =
      Eigen::MatrixXd::NullaryExpr(size, size, [&] { return random.NextUniform(-3.0, 3.0); });
  const Eigen::MatrixXd information = root.transpose() * root;
  constraint.information = 0.5 * (information + information.transpose()).eval();
  constraint.information.diagonal().array() += 1.0;
  const Pose2 first_from_map = Inverse(graph.map_from_node[constraint.nodes.front()]);
  for (std::size_t i = 1; i < constraint.nodes.size(); ++i) {
    constraint.first_from_node.push_back(first_from_map * graph.map_from_node[constraint.nodes[i]] *
                                         RandomPose(random, range_m, range_rad));
  }
  return constraint;
}

}  // namespace loci
