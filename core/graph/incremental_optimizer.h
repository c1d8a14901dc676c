// SPDX-License-Identifier: Apache-2.0
// A pose graph that is kept at its optimum while it grows.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/graph/elimination_tree.h"
#include "core/graph/pose_graph.h"
#include "core/graph/robust_kernel.h"

namespace loci {

struct IncrementalOptions {
  // A node or point is linearised again once it is further than this from where it was.
  double relinearise_m = 0.02;
  double relinearise_rad = 0.01;
  // Steps of Gauss-Newton in one Update, at most.
  int iterations_max = 6;
  // A step is passed on to a node only if it moves what the node is tied to by more than this.
  double step_min = 1e-5;
  RobustKernel kernel;  // for constraints marked robust
};

struct UpdateSummary {
  int iterations = 0;
  std::size_t eliminated = 0;  // nodes and points that were eliminated again, in all steps
  std::size_t relinearised = 0;
  bool converged = false;  // nothing is left to be linearised again
  bool determined = true;  // false: something is not tied in all directions, and nothing has moved
};

// Gauss-Newton, incrementally (Kaess et al., iSAM2, IJRR 2012): only what a new constraint concerns
// is linearised, eliminated and solved again. Holds the lowest node of each component that has no
// fixed one. Deterministic. Errors, Jacobians and perturbations are those of PoseGraph.
class IncrementalOptimizer {
 public:
  explicit IncrementalOptimizer(const IncrementalOptions& options);

  // Nodes and points are numbered from 0 as they come.
  std::uint32_t AddNode(const Pose2& map_from_node, bool fixed);
  std::uint32_t AddPoint(const Eigen::Vector2d& point_in_map);
  // A constraint, which must be valid. Pose and point constraints are numbered apart, from 0.
  std::uint32_t AddConstraint(const GraphConstraint& constraint);
  std::uint32_t AddConstraint(const PointConstraint& constraint);

  // Moves all to the optimum, or on the way to it.
  UpdateSummary Update();

  // Where everything is now, with all constraints.
  PoseGraph Graph() const;
  Pose2 map_from_node(std::uint32_t node) const;

 private:
  struct Node {
    Pose2 linearised;
    std::uint32_t variable = EliminationTree::kNone;  // kNone: held
    bool fixed = false;
    std::vector<std::uint32_t> constraints;
    std::vector<std::uint32_t> point_constraints;
  };
  struct Point {
    Eigen::Vector2d linearised = Eigen::Vector2d::Zero();
    std::uint32_t variable = EliminationTree::kNone;  // kNone: no constraint yet
    std::vector<std::uint32_t> point_constraints;
  };
  // What a variable of the tree is.
  struct Owner {
    std::uint32_t index = 0;
    bool is_point = false;
  };

  void SetPoseTerm(std::uint32_t constraint);
  void SetPointTerm(std::uint32_t constraint);
  bool HasMoved(std::uint32_t variable) const;
  void Relinearise(const std::vector<std::uint32_t>& variables);

  IncrementalOptions options_;
  PoseGraph graph_;  // its constraints count; its poses are the linearisation points
  std::vector<Node> nodes_;
  std::vector<Point> points_;
  std::vector<std::uint32_t> pose_terms_;   // per constraint
  std::vector<std::uint32_t> point_terms_;  // per point constraint
  std::vector<Owner> owners_;               // per variable of the tree
  EliminationTree tree_;
  std::vector<std::uint32_t> recent_;  // variables that should be eliminated last
  std::vector<std::uint32_t> solved_;
};

}  // namespace loci
