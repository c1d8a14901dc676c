// SPDX-License-Identifier: Apache-2.0
#include "core/graph/joint_constraint.h"

#include <cstdint>
#include <utility>

#include "core/base/check.h"
#include "core/graph/plane_problem.h"
#include "core/graph/quadratic.h"

namespace loci {
namespace {

Eigen::Index RowOf(std::size_t pose) {
  return 3 * static_cast<Eigen::Index>(pose);
}

}  // namespace

// Each error is that of a pair.
LinearisedJoint Linearised(const PoseGraph& graph, const JointConstraint& constraint) {
  const std::size_t count = constraint.first_from_node.size();
  LinearisedJoint result;
  result.error.resize(RowOf(count));
  result.jacobian.setZero(RowOf(count), RowOf(count + 1));
  GraphConstraint pair;
  pair.from = constraint.nodes.front();
  for (std::size_t i = 0; i < count; ++i) {
    pair.to = constraint.nodes[i + 1];
    pair.from_from_to = constraint.first_from_node[i];
    const LinearisedPair<3, 3, 3> linearised = Linearised(graph, pair);
    result.error.segment<3>(RowOf(i)) = linearised.error;
    result.jacobian.block<3, 3>(RowOf(i), 0) = linearised.jacobian_a;
    result.jacobian.block<3, 3>(RowOf(i), RowOf(i + 1)) = linearised.jacobian_b;
  }
  return result;
}

void WriteTerm(const LinearisedJoint& linearised,
               const Eigen::MatrixXd& weight,
               const std::vector<bool>& is_free,
               double* values) {
  Eigen::MatrixXd jacobian(linearised.jacobian.rows(), linearised.jacobian.cols());
  Eigen::Index size = 0;
  for (std::size_t i = 0; i < is_free.size(); ++i) {
    if (is_free[i]) {
      jacobian.middleCols<3>(size) = linearised.jacobian.middleCols<3>(RowOf(i));
      size += 3;
    }
  }
  const Eigen::MatrixXd weighted = jacobian.leftCols(size).transpose() * weight;
  const Eigen::MatrixXd h = weighted * jacobian.leftCols(size);
  const Eigen::VectorXd b = -(weighted * linearised.error);
  for (Eigen::Index column = 0; column < size; ++column) {
    double* to = values + column * (size + 1);
    for (Eigen::Index row = column; row < size; ++row) {
      to[row] = h(row, column);
    }
    to[size] = b(column);
  }
}

GraphConstraint PairOf(const JointConstraint& constraint) {
  LOCI_CHECK(constraint.nodes.size() == 2);
  GraphConstraint pair;
  pair.from = constraint.nodes[0];
  pair.to = constraint.nodes[1];
  pair.from_from_to = constraint.first_from_node.front();
  pair.information = constraint.information;
  return pair;
}

JointConstraint JointOf(const GraphConstraint& constraint) {
  return {{constraint.from, constraint.to}, {constraint.from_from_to}, constraint.information};
}

GraphConstraint ImpliedPair(const JointConstraint& constraint, std::size_t i) {
  const Eigen::Index size = constraint.information.rows();
  const Eigen::Index row = RowOf(i - 1);
  // The error of nodes[i] first.
  Quadratic form;
  form.h = constraint.information;
  form.b = Eigen::VectorXd::Zero(size);
  form.h.topRows<3>().swap(form.h.middleRows<3>(row));
  form.h.leftCols<3>().swap(form.h.middleCols<3>(row));
  GraphConstraint pair;
  pair.from = constraint.nodes.front();
  pair.to = constraint.nodes[i];
  pair.from_from_to = constraint.first_from_node[i - 1];
  pair.information = MinimisedOverRest(form, 3).h;
  return pair;
}

PoseGraph WithImpliedPairs(PoseGraph graph) {
  for (const JointConstraint& constraint : std::exchange(graph.joint_constraints, {})) {
    for (std::size_t i = 1; i < constraint.nodes.size(); ++i) {
      graph.constraints.push_back(ImpliedPair(constraint, i));
    }
  }
  return graph;
}

}  // namespace loci
