// SPDX-License-Identifier: Apache-2.0
// A pose graph that is kept at its optimum while it grows.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/status.h"
#include "core/graph/elimination_tree.h"
#include "core/graph/marginalise.h"
#include "core/graph/pose_graph.h"
#include "core/graph/robust_kernel.h"

namespace loci {

struct IncrementalOptions {
  // A node is linearised again once what its linearisation neglects of a constraint may be more
  // than this many sigma of it,
  double relinearise_sigma = 0.01;
  // and a node or point once it is further than this from where it was.
  double relinearise_m = 0.2;
  double relinearise_rad = 0.1;
  // Steps of Gauss-Newton in one Update, at most; what they leave is for the next one.
  int iterations_max = 3;
  // A step is passed on to a node only if it moves what the node is tied to by more than this.
  double step_min = 5e-4;
  RobustKernel kernel;  // for constraints marked robust
  // One of those is weighed anew once its weight has changed by more than this part of it.
  double reweigh = 1e-3;
  // A node is not marginalised while fewer constraints than this have come after one of its own:
  // until then that one may be taken back. A closure is judged by those that follow it.
  std::uint32_t retract_window = 100;
  // What marginalised nodes leave: MarginalOptions.
  std::size_t dense_neighbours_max = 4;
};

struct UpdateSummary {
  int iterations = 0;
  std::size_t eliminated = 0;    // nodes and points, in all steps
  std::size_t relinearised = 0;  // the same
  bool converged = false;        // nothing is left to be linearised again
  // false: something is not tied in all directions, and no step was taken after those counted.
  bool determined = true;
};

// What the optimiser's memory grows with, apart from what each number that it has given costs for
// good: about 132 bytes for a node, 48 for a point, 125 for a constraint of poses and 92 for one of
// a point, and up to twice that while vectors have room to grow. Numbers are never used again, so
// that this grows with all that ever came.
struct IncrementalSize {
  std::size_t variables = 0;  // of the elimination tree, with room for those that come
  std::size_t terms = 0;      // the same
  std::size_t fronts = 0;     // the same
  // Constraints of pairs and more that marginalised nodes have left, and joint ones that were
  // given; the same.
  std::size_t joints = 0;
};

// Gauss-Newton, incrementally (Kaess et al., iSAM2, IJRR 2012): only what a new constraint concerns
// is linearised, eliminated and solved again; a node that no loop reaches costs the same however
// large the graph is. Errors, Jacobians and perturbations are those of PoseGraph. Deterministic.
//
// Holds the nodes that are fixed, and the lowest of each component that has none. A constraint of
// poses that joins two components moves one of them as a whole, to where the constraint says: the
// one without a fixed node, whichever has the lower node; if neither has one, that with the higher
// lowest node. If both have one, neither moves as a whole.
//
// A robust constraint counts in full until a first step has been taken with it, and by the kernel
// from then on: the map may be far from where a right closure leads. Those that are loaded are
// weighed at once.
//
// Nodes can be marginalised (marginalise.h), so that a graph can be bounded by area. What they
// leave over the same nodes is added up, so that it is bounded too.
class IncrementalOptimizer {
 public:
  explicit IncrementalOptimizer(const IncrementalOptions& options);

  // Takes a whole graph, where it is, without priors and fixed points. Nothing has been added
  // before.
  void Load(const PoseGraph& graph);

  // Nodes and points are numbered from 0 as they come; numbers are never used again.
  std::uint32_t AddNode(const Pose2& map_from_node, bool fixed);
  std::uint32_t AddPoint(const Eigen::Vector2d& point_in_map);
  // Constraints must be valid (ValidateGraph), and of nodes that are there: neither yet to come nor
  // marginalised. Those of poses and of points are numbered apart,
  // from 0 as they come; numbers are never used again.
  std::uint32_t AddConstraint(const GraphConstraint& constraint);
  std::uint32_t AddConstraint(const PointConstraint& constraint);
  // Has no number, and stays.
  void AddConstraint(const JointConstraint& constraint);
  // As if it had never been there, with two exceptions: what nodes have left that were marginalised
  // in the meantime was linearised with it, and a component that it moved as a whole stays where it
  // was moved to. Errors: kNotFound, it is not there; kFailedPrecondition, one of its
  // nodes has been marginalised.
  Status RemoveConstraint(std::uint32_t constraint);
  Status RemovePointConstraint(std::uint32_t constraint);
  // Removes a node, and leaves its marginal at the present poses: best after an Update that has
  // converged. Errors: kNotFound, no such node, or it has been marginalised; kFailedPrecondition,
  // the node is fixed, has a point constraint or, in the retract window, a constraint, or its
  // marginal cannot be had (MarginalOf). Nothing has changed then.
  Status MarginaliseNode(std::uint32_t node);

  // Moves all to the optimum, or on the way to it.
  UpdateSummary Update();

  // Makes covariances those of the present linearisation, which they are after an Update that has
  // converged. False if something is not tied in all directions: there are none then.
  bool Factorise();
  // Of from_from_to = Inverse(map_from_from) * map_from_to, as from_from_to * Exp(xi), (x, y,
  // theta). Positive semidefinite; costs the fronts above the two in the elimination tree. For
  // nodes of two components the answer says nothing about their relation, since both are held.
  Eigen::Matrix3d RelativeCovariance(std::uint32_t from, std::uint32_t to) const;

  // Nodes that may have moved since this was last called, each once.
  std::vector<std::uint32_t> TakeMovedNodes();

  Pose2 map_from_node(std::uint32_t node) const;
  Eigen::Vector2d point_in_map(std::uint32_t point) const;
  // All nodes, points and constraints that are there, at where they are now. Marginalised nodes
  // have no constraints, and are where they were last.
  PoseGraph Graph() const;
  IncrementalSize Size() const;

 private:
  static constexpr std::uint32_t kNone = EliminationTree::kNone;

  enum class ConstraintState : std::uint8_t { kThere, kRemoved, kMarginalised };
  struct Node {
    std::uint32_t variable = kNone;  // kNone: held
    bool held = true;
    bool marginalised = false;
    // Over the constraints that it has: the greatest information about a position, as a root
    // (1 / m), and the furthest that one reaches.
    double stiffness = 0.0;
    double reach_m = 0.0;
    std::vector<std::uint32_t> constraints;
    std::vector<std::uint32_t> point_constraints;
    std::vector<std::uint32_t> joints;
  };
  struct Point {
    std::uint32_t variable = kNone;  // kNone: no constraint yet
    std::vector<std::uint32_t> point_constraints;
  };
  // A set of nodes that constraints join, by a tree of its members (union-find).
  struct Component {
    std::uint32_t parent = 0;
    std::uint32_t lowest = 0;  // of the root: the lowest node
    std::uint32_t fixed = 0;   // of the root: how many are fixed
  };
  // What a variable of the tree is.
  struct Owner {
    std::uint32_t index = 0;
    bool is_point = false;
  };

  class Search;

  std::uint32_t AddVariable(int size, Owner owner);
  std::uint32_t FindRoot(std::uint32_t node);
  std::uint32_t Append(const GraphConstraint& constraint, double weight);
  std::uint32_t Append(const PointConstraint& constraint, double weight);
  void Join(std::uint32_t from, std::uint32_t to, const Pose2* from_from_to);
  std::vector<std::uint32_t> ConnectedTo(std::uint32_t node) const;
  bool AreConnected(std::uint32_t a, std::uint32_t b) const;
  void Regroup(const std::vector<std::uint32_t>& nodes);
  void MoveTogether(const std::vector<std::uint32_t>& nodes, const Pose2& map_from_old);
  void RegroupIfApart(std::uint32_t a, std::uint32_t b);
  void RemoveVariable(std::uint32_t variable);
  void Hold(std::uint32_t node);
  void Release(std::uint32_t node);
  void MakeTerm(std::uint32_t constraint);
  void MakePointTerm(std::uint32_t constraint);
  void MakeJointTerm(std::uint32_t joint);
  void SetTerm(std::uint32_t constraint);
  void SetPointTerm(std::uint32_t constraint);
  void SetJointTerm(std::uint32_t joint);
  template <typename Constraint>
  void WriteConstraint(const Constraint& constraint,
                       double weight,
                       bool second_is_free,
                       std::uint32_t term);
  double PresentWeight(std::uint32_t constraint) const;
  double PresentPointWeight(std::uint32_t constraint) const;
  bool Reweigh(std::span<const std::uint32_t> solved);
  void RememberMoved(std::uint32_t node);
  void RemakeTermsOf(std::uint32_t node);
  void Detach(std::uint32_t constraint, ConstraintState state);
  void AddJoint(JointConstraint joint);
  void AddToJoints(JointConstraint joint);
  void RemoveJoint(std::uint32_t joint);
  std::uint32_t FindNested(const JointConstraint& joint,
                           const std::vector<std::uint32_t>& apart) const;
  PoseGraph PresentPoses(const std::vector<std::uint32_t>& nodes) const;
  Status CheckMarginalisable(std::uint32_t node) const;
  std::vector<std::uint32_t> NeighboursOf(std::uint32_t node) const;
  StatusOr<NodeMarginal> MarginalOfNode(std::uint32_t node,
                                        const std::vector<std::uint32_t>& neighbours) const;
  void Settle(std::uint32_t variable);
  bool HasMoved(std::uint32_t variable) const;
  bool IsThere(std::uint32_t node) const {
    return node < nodes_.size() && !nodes_[node].marginalised;
  }
  void Stiffen(std::uint32_t node, double information_per_m2, const Eigen::Vector2d& reach);
  void StiffenBy(const GraphConstraint& constraint, std::uint32_t node);
  void StiffenBy(const PointConstraint& constraint);
  void StiffenBy(const JointConstraint& constraint, std::size_t i, std::uint32_t node);
  void StiffenAnew(std::uint32_t node);
  void Relinearise(std::vector<std::uint32_t>& variables);

  IncrementalOptions options_;
  PoseGraph graph_;  // poses and points are where they were linearised
  std::vector<Node> nodes_;
  std::vector<Point> points_;
  std::vector<std::uint32_t> terms_;        // per constraint; kNone: removed, or all of it is held
  std::vector<std::uint32_t> point_terms_;  // per point constraint
  std::vector<std::uint32_t> joint_terms_;  // per joint constraint; the same
  std::vector<double> weights_;             // per constraint, by the kernel; 1 if it is not robust
  std::vector<double> point_weights_;       // per point constraint; the same
  std::vector<ConstraintState> states_;     // of constraints
  std::vector<bool> point_removed_;         // point constraints
  std::vector<std::uint32_t> free_joints_;  // joint constraints that are not there
  std::vector<Component> components_;       // per node
  std::vector<Owner> owners_;               // per variable of the tree
  EliminationTree tree_;
  std::vector<std::uint32_t> recent_;  // variables of the last constraints: eliminated last
  bool updated_ = false;               // since recent_ grew
  std::vector<std::uint32_t> moved_nodes_;
  std::vector<bool> has_moved_;  // per node: is one of them
};

}  // namespace loci
