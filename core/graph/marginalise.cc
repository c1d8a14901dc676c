// SPDX-License-Identifier: Apache-2.0
// Schur complement of one node, and the spanning tree for its neighbours.
#include "core/graph/marginalise.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "core/base/math.h"
#include "core/graph/joint_constraint.h"
#include "core/graph/plane_problem.h"
#include "core/graph/quadratic.h"

namespace loci {
namespace {

std::string NameOf(std::uint32_t node) {
  return "node " + std::to_string(node);
}

bool Names(const GraphConstraint& constraint, std::uint32_t node) {
  return constraint.from == node || constraint.to == node;
}
bool Names(const JointConstraint& constraint, std::uint32_t node) {
  return std::find(constraint.nodes.begin(), constraint.nodes.end(), node) !=
         constraint.nodes.end();
}

// What a marginal cannot hold, as long as it knows relative poses of nodes only.
template <typename Term, typename NodeOf>
Status RefuseTerms(const std::vector<Term>& terms,
                   std::uint32_t node,
                   const std::string& field,
                   const NodeOf& node_of) {
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (node_of(terms[i]) == node) {
      return FailedPreconditionError("has " + field + "[" + std::to_string(i) +
                                     "], cannot be marginalised");
    }
  }
  return {};
}

Status CheckNode(const PoseGraph& graph, std::uint32_t node) {
  if (node >= graph.map_from_node.size()) {
    return InvalidArgumentError("must be < " + std::to_string(graph.map_from_node.size()));
  }
  if (graph.IsFixed(node)) {
    return FailedPreconditionError("is fixed, cannot be marginalised");
  }
  for (std::size_t i = 0; i < graph.constraints.size(); ++i) {
    if (graph.constraints[i].from == node && graph.constraints[i].to == node) {
      return InvalidArgumentError("constraints[" + std::to_string(i) + "] joins it to itself");
    }
  }
  const auto of_prior = [](const auto& prior) { return prior.node; };
  LOCI_RETURN_IF_ERROR(RefuseTerms(graph.pose_priors, node, "pose_priors", of_prior));
  LOCI_RETURN_IF_ERROR(RefuseTerms(graph.position_priors, node, "position_priors", of_prior));
  return RefuseTerms(
      graph.point_constraints, node, "point_constraints", [](const auto& c) { return c.from; });
}

// A node's neighbours, ascending.
std::vector<std::uint32_t> NeighboursOf(const PoseGraph& graph, std::uint32_t node) {
  std::vector<std::uint32_t> neighbours;
  for (const GraphConstraint& constraint : graph.constraints) {
    if (Names(constraint, node)) {
      neighbours.push_back(constraint.from == node ? constraint.to : constraint.from);
    }
  }
  for (const JointConstraint& constraint : graph.joint_constraints) {
    if (Names(constraint, node)) {
      std::copy_if(constraint.nodes.begin(),
                   constraint.nodes.end(),
                   std::back_inserter(neighbours),
                   [node](std::uint32_t other) { return other != node; });
    }
  }
  std::sort(neighbours.begin(), neighbours.end());
  neighbours.erase(std::unique(neighbours.begin(), neighbours.end()), neighbours.end());
  return neighbours;
}

// Constraints as one quadratic form of right perturbations of some nodes. The first of them does
// not move: what is said of relative poses is then said of the others' poses.
class RelativeForm {
 public:
  RelativeForm(const PoseGraph& graph, std::vector<std::uint32_t> nodes)
      : graph_(graph), nodes_(std::move(nodes)) {
    const auto size = 3 * (static_cast<Eigen::Index>(nodes_.size()) - 1);
    form_ = {Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  }

  void Add(const GraphConstraint& constraint, double weight) {
    const LinearisedPair<3, 3, 3> linearised = Linearised(graph_, constraint);
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian << linearised.jacobian_a, linearised.jacobian_b;
    Add({constraint.from, constraint.to},
        jacobian,
        weight * constraint.information,
        linearised.error);
  }
  void Add(const JointConstraint& constraint) {
    const LinearisedJoint linearised = Linearised(graph_, constraint);
    Add(constraint.nodes, linearised.jacobian, constraint.information, linearised.error);
  }

  const Quadratic& form() const { return form_; }

 private:
  std::optional<Eigen::Index> ColumnOf(std::uint32_t node) const {
    const auto place = std::find(nodes_.begin(), nodes_.end(), node) - nodes_.begin();
    return place == 0 ? std::nullopt : std::optional<Eigen::Index>(3 * (place - 1));
  }

  void Add(const std::vector<std::uint32_t>& nodes,
           const Eigen::MatrixXd& jacobian,
           const Eigen::MatrixXd& weight,
           const Eigen::VectorXd& error) {
    const Eigen::MatrixXd weighted = jacobian.transpose() * weight;
    const Eigen::MatrixXd h = weighted * jacobian;
    const Eigen::VectorXd b = -(weighted * error);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const std::optional<Eigen::Index> row = ColumnOf(nodes[i]);
      if (!row.has_value()) {
        continue;
      }
      const auto from_row = 3 * static_cast<Eigen::Index>(i);
      form_.b.segment<3>(*row) += b.segment<3>(from_row);
      for (std::size_t j = 0; j < nodes.size(); ++j) {
        if (const std::optional<Eigen::Index> column = ColumnOf(nodes[j]); column.has_value()) {
          form_.h.block<3, 3>(*row, *column) +=
              h.block<3, 3>(from_row, 3 * static_cast<Eigen::Index>(j));
        }
      }
    }
  }

  const PoseGraph& graph_;
  std::vector<std::uint32_t> nodes_;
  Quadratic form_;
};

// The constraints of a node, as a form of its neighbours.
struct Star {
  std::vector<std::uint32_t> neighbours;  // the form is of all but the first
  Quadratic marginal;
  Eigen::VectorXd scale;  // in whose units a direction of the form is unknown
};

Star StarOf(const PoseGraph& graph,
            std::uint32_t node,
            std::vector<std::uint32_t> neighbours,
            const RobustKernel& kernel) {
  std::vector<std::uint32_t> nodes = neighbours;
  nodes.push_back(node);
  RelativeForm form(graph, nodes);
  for (const GraphConstraint& constraint : graph.constraints) {
    if (Names(constraint, node)) {
      form.Add(constraint, constraint.robust ? kernel.Weight(Chi2Of(graph, constraint)) : 1.0);
    }
  }
  for (const JointConstraint& constraint : graph.joint_constraints) {
    if (Names(constraint, node)) {
      form.Add(constraint);
    }
  }
  const Eigen::Index kept = form.form().b.size() - 3;
  return {std::move(neighbours),
          MinimisedOverRest(form.form(), kept),
          form.form().h.diagonal().head(kept)};
}

// The constraint whose quadratic form at the present poses is H = `information`, b = H `shift`, for
// perturbations of nodes[1], nodes[2] .. in the frame of nodes[0].
//
// With the measurement Z = M * D, M the present relative pose and D that of `shift`, the error is
// e = vector(D^-1) = -R(D)^T shift, and d e / d xi = R(D)^T (plane_problem.cc; R turns x and y).
// Hence J^T W J = H for W = R(D)^T H R(D), and -J^T W e = H shift.
StatusOr<JointConstraint> ConstraintAt(const PoseGraph& graph,
                                       const std::vector<std::uint32_t>& nodes,
                                       const Eigen::MatrixXd& information,
                                       const Eigen::VectorXd& shift) {
  JointConstraint constraint;
  constraint.nodes = nodes;
  const Eigen::Index size = shift.size();
  Eigen::MatrixXd turn = Eigen::MatrixXd::Identity(size, size);  // R(D)^T
  const Pose2 first_from_map = Inverse(graph.map_from_node[nodes.front()]);
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    const Eigen::Index row = 3 * static_cast<Eigen::Index>(i - 1);
    const Pose2 moved{shift(row), shift(row + 1), shift(row + 2)};
    // As a pose, the shift would be a turn the other way round.
    if (!(moved.theta > -kPi && moved.theta < kPi)) {
      return FailedPreconditionError(
          "constraints disagree about a relative pose of the neighbours by " +
          std::to_string(moved.theta) + " rad, must be less than pi");
    }
    constraint.first_from_node.push_back(first_from_map * graph.map_from_node[nodes[i]] * moved);
    const double cosine = Cos(moved.theta);
    const double sine = Sin(moved.theta);
    turn.block<2, 2>(row, row) << cosine, sine, -sine, cosine;
  }
  const Eigen::MatrixXd turned = turn * information * turn.transpose();
  constraint.information = 0.5 * (turned + turned.transpose());
  return constraint;
}

// The relative pose of two neighbours, by their places among them.
struct Edge {
  std::size_t from = 0;
  std::size_t to = 0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double log_determinant = std::numeric_limits<double>::infinity();  // infinite: not known
};

// Edges between all neighbours, and the tree that is chosen of them.
class NeighbourTree {
 public:
  NeighbourTree(const PoseGraph& graph,
                const std::vector<std::uint32_t>& neighbours,
                const Eigen::MatrixXd& covariance)
      : graph_(graph), neighbours_(neighbours), covariance_(covariance) {
    FindTree();
  }

  const std::vector<Edge>& edges() const { return edges_; }

  // Perturbations of the edges' relative poses from those of the neighbours: xi_to -
  // Adjoint(to_from_from) xi_from, where the first neighbour's is 0.
  Eigen::MatrixXd FromNeighbours() const {
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(covariance_.rows(), covariance_.cols());
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const Eigen::Index row = 3 * static_cast<Eigen::Index>(i);
      matrix.block<3, 3>(row, ColumnOf(edges_[i].to)) = Eigen::Matrix3d::Identity();
      if (edges_[i].from > 0) {
        matrix.block<3, 3>(row, ColumnOf(edges_[i].from)) = -AdjointOf(edges_[i]);
      }
    }
    return matrix;
  }

 private:
  static Eigen::Index ColumnOf(std::size_t place) {
    return 3 * (static_cast<Eigen::Index>(place) - 1);
  }
  Eigen::Matrix3d AdjointOf(const Edge& edge) const {
    return Adjoint(Inverse(graph_.map_from_node[neighbours_[edge.to]]) *
                   graph_.map_from_node[neighbours_[edge.from]]);
  }

  Edge EdgeBetween(std::size_t a, std::size_t b) const {
    Edge edge;
    edge.from = std::min(a, b);
    edge.to = std::max(a, b);
    const Eigen::Index to = ColumnOf(edge.to);
    Eigen::Matrix3d sum = covariance_.block<3, 3>(to, to);
    if (edge.from > 0) {
      const Eigen::Index from = ColumnOf(edge.from);
      const Eigen::Matrix3d adjoint = AdjointOf(edge);
      const Eigen::Matrix3d cross = adjoint * covariance_.block<3, 3>(from, to);
      sum += adjoint * covariance_.block<3, 3>(from, from) * adjoint.transpose() - cross -
             cross.transpose();
    }
    edge.covariance = 0.5 * (sum + sum.transpose());
    const Eigen::LLT<Eigen::Matrix3d> factor(edge.covariance);
    if (factor.info() == Eigen::Success) {
      const Eigen::Matrix3d root = factor.matrixL();
      edge.log_determinant = 2.0 * (Log(root(0, 0)) + Log(root(1, 1)) + Log(root(2, 2)));
    }
    return edge;
  }

  // Prim's algorithm; of edges of one weight, the one found first.
  void FindTree() {
    std::vector<Edge> nearest;  // per neighbour that is not in the tree, from 1
    for (std::size_t place = 1; place < neighbours_.size(); ++place) {
      nearest.push_back(EdgeBetween(0, place));
    }
    std::vector<bool> in_tree(neighbours_.size());
    for (std::size_t count = 1; count < neighbours_.size(); ++count) {
      std::size_t next = 0;
      for (std::size_t place = 1; place < neighbours_.size(); ++place) {
        if (!in_tree[place] &&
            (next == 0 || nearest[place - 1].log_determinant < nearest[next - 1].log_determinant)) {
          next = place;
        }
      }
      in_tree[next] = true;
      edges_.push_back(nearest[next - 1]);
      for (std::size_t place = 1; place < neighbours_.size(); ++place) {
        if (!in_tree[place]) {
          const Edge edge = EdgeBetween(next, place);
          if (edge.log_determinant < nearest[place - 1].log_determinant) {
            nearest[place - 1] = edge;
          }
        }
      }
    }
  }

  const PoseGraph& graph_;
  const std::vector<std::uint32_t>& neighbours_;
  const Eigen::MatrixXd& covariance_;  // of the neighbours but the first, which does not move
  std::vector<Edge> edges_;
};

Status RefuseTree(const Star& star, Eigen::Index rank, const MarginalOptions& options) {
  return FailedPreconditionError("its constraints determine " + std::to_string(rank) + " of " +
                                 std::to_string(star.scale.size()) +
                                 " numbers of the relative poses of " +
                                 std::to_string(star.neighbours.size()) +
                                 " neighbours; must be all where there are more than " +
                                 std::to_string(options.dense_neighbours_max) + " neighbours");
}

// Both forms have the same gradient at the present poses: with T from the neighbours to the edges,
// T^T b_edges = b.
StatusOr<NodeMarginal> SparseMarginal(const PoseGraph& graph,
                                      const Star& star,
                                      const MarginalOptions& options) {
  const Quadratic& exact = star.marginal;
  const RankedInverse covariance = PseudoInverse(exact.h, star.scale);
  if (covariance.rank < exact.b.size()) {
    return RefuseTree(star, covariance.rank, options);
  }
  const NeighbourTree tree(graph, star.neighbours, covariance.inverse);
  const Eigen::MatrixXd edges_from_neighbours = tree.FromNeighbours();
  const Eigen::VectorXd b = edges_from_neighbours.transpose().partialPivLu().solve(exact.b);
  NodeMarginal result;
  for (std::size_t i = 0; i < tree.edges().size(); ++i) {
    const Edge& edge = tree.edges()[i];
    const Eigen::LLT<Eigen::Matrix3d> factor(edge.covariance);
    if (factor.info() != Eigen::Success) {
      return FailedPreconditionError(
          "its constraints give two of its " + std::to_string(star.neighbours.size()) +
          " neighbours a relative pose whose covariance cannot be told from a singular one");
    }
    const Eigen::Matrix3d information = factor.solve(Eigen::Matrix3d::Identity());
    const Eigen::Vector3d shift = edge.covariance * b.segment<3>(3 * static_cast<Eigen::Index>(i));
    LOCI_ASSIGN_OR_RETURN(
        const JointConstraint constraint,
        ConstraintAt(
            graph, {star.neighbours[edge.from], star.neighbours[edge.to]}, information, shift));
    result.constraints.push_back(PairOf(constraint));
  }
  return result;
}

StatusOr<NodeMarginal> DenseMarginal(const PoseGraph& graph, const Star& star) {
  const Quadratic& exact = star.marginal;
  LOCI_ASSIGN_OR_RETURN(JointConstraint constraint,
                        ConstraintAt(graph, star.neighbours, exact.h, Minimum(exact, star.scale)));
  NodeMarginal result;
  if (star.neighbours.size() == 2) {
    result.constraints.push_back(PairOf(constraint));
  } else {
    result.joint_constraints.push_back(std::move(constraint));
  }
  return result;
}

}  // namespace

StatusOr<NodeMarginal> UnnamedMarginalOf(const PoseGraph& graph,
                                         std::uint32_t node,
                                         const MarginalOptions& options) {
  LOCI_RETURN_IF_ERROR(CheckNode(graph, node));
  std::vector<std::uint32_t> neighbours = NeighboursOf(graph, node);
  const std::size_t count = neighbours.size();
  if (count < 2) {
    return NodeMarginal{};
  }
  const Star star = StarOf(graph, node, std::move(neighbours), options.kernel);
  return count <= std::max<std::size_t>(2, options.dense_neighbours_max)
             ? DenseMarginal(graph, star)
             : SparseMarginal(graph, star, options);
}

StatusOr<NodeMarginal> MarginalOf(const PoseGraph& graph,
                                  std::uint32_t node,
                                  const MarginalOptions& options) {
  StatusOr<NodeMarginal> marginal = UnnamedMarginalOf(graph, node, options);
  if (!marginal.ok()) {
    return Status(marginal.status().code(), NameOf(node) + ": " + marginal.status().message());
  }
  return marginal;
}

StatusOr<JointConstraint> SumOf(const PoseGraph& graph,
                                const std::vector<JointConstraint>& constraints) {
  std::vector<std::uint32_t> nodes;
  for (const JointConstraint& constraint : constraints) {
    nodes.insert(nodes.end(), constraint.nodes.begin(), constraint.nodes.end());
  }
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  RelativeForm form(graph, nodes);
  for (const JointConstraint& constraint : constraints) {
    form.Add(constraint);
  }
  return ConstraintAt(graph, nodes, form.form().h, Minimum(form.form(), form.form().h.diagonal()));
}

Status MarginaliseNode(std::uint32_t node, const MarginalOptions& options, PoseGraph& graph) {
  LOCI_ASSIGN_OR_RETURN(NodeMarginal marginal, MarginalOf(graph, node, options));
  const auto names = [node](const auto& constraint) { return Names(constraint, node); };
  std::erase_if(graph.constraints, names);
  std::erase_if(graph.joint_constraints, names);
  graph.constraints.insert(
      graph.constraints.end(), marginal.constraints.begin(), marginal.constraints.end());
  std::move(marginal.joint_constraints.begin(),
            marginal.joint_constraints.end(),
            std::back_inserter(graph.joint_constraints));

  graph.map_from_node.erase(graph.map_from_node.begin() + static_cast<std::ptrdiff_t>(node));
  if (node < graph.fixed.size()) {
    graph.fixed.erase(graph.fixed.begin() + static_cast<std::ptrdiff_t>(node));
  }
  const auto move_down = [node](std::uint32_t& other) { other -= other > node ? 1 : 0; };
  for (GraphConstraint& constraint : graph.constraints) {
    move_down(constraint.from);
    move_down(constraint.to);
  }
  for (JointConstraint& constraint : graph.joint_constraints) {
    std::for_each(constraint.nodes.begin(), constraint.nodes.end(), move_down);
  }
  for (PointConstraint& constraint : graph.point_constraints) {
    move_down(constraint.from);
  }
  for (PosePrior& prior : graph.pose_priors) {
    move_down(prior.node);
  }
  for (PositionPrior& prior : graph.position_priors) {
    move_down(prior.node);
  }
  return {};
}

}  // namespace loci
