// SPDX-License-Identifier: Apache-2.0
// Closures that say the same, found before any of them is believed.
//
// Pairs of closures are tried as Mangelson et al. do (core/graph/consistent_set.h): two closures
// and the ways between their ends on both sides make a loop, whose error is held against its
// covariance.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/se2.h"
#include "core/graph/path_covariance.h"
#include "core/graph/pose_graph.h"

namespace loci {

// The quantile of chi2 with three degrees of freedom that a true constraint exceeds once in a
// thousand times.
inline constexpr double kGateChi2 = 16.266;

// A robust constraint, turned so that its ends lie on the sides on which those of others do.
struct Closure {
  std::uint32_t constraint = 0;  // of the graph
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  Pose2 a_from_b;
  Eigen::Matrix3d covariance;  // of a_from_b * Exp(xi)
};

// The robust constraints with an information that can be inverted, sorted by (a, b, constraint). An
// end is `a` if it is in the component (of the constraints that are not robust) with the lower
// number, or else if it has the lower index.
std::vector<Closure> ClosuresOf(const PoseGraph& graph);

// The pose of a node in another's frame, and its covariance, as from_from_to * Exp(xi).
struct Relation {
  Pose2 from_from_to;
  Eigen::Matrix3d covariance;
};

// The error of a loop or a prediction, and what it may be.
struct Discrepancy {
  double chi2 = 0.0;
  double sigma_product = 0.0;  // the root of the covariance's determinant, m^2 rad
};

// Of the loop over `first` and `second`, given first's ends from second's: first_a_from_second_a
// and first_b_from_second_b.
Discrepancy CompareClosures(const Closure& first,
                            const Closure& second,
                            const Relation& a_side,
                            const Relation& b_side);

// Of the closure and what is known of b from a without it.
Discrepancy CompareClosure(const Closure& closure, const Relation& predicted_a_from_b);

// The part of all poses on `area_m2` that passes kGateChi2 by chance: the volume of the gate, where
// covariances are `covariance_scale` times what the discrepancy says.
double ChanceOf(const Discrepancy& discrepancy, double covariance_scale, double area_m2);

// Where poses may be by chance, at least 1 m^2: the box that the middle nine tenths of the
// positions need in x and in y, as much larger as it would have to be for all if they lay evenly.
// So a few positions far out, which one false closure can make, do not count.
double AreaOf(const std::vector<Eigen::Vector2d>& positions);

struct ClosureClusters {
  std::vector<Closure> closures;
  // Of indices into closures; those that agree with the most others come first. Largest first.
  std::vector<std::vector<std::uint32_t>> clusters;
  // The part of the stated covariances that the errors really have, at most 1. Public graphs state
  // up to sixty times too much, and a gate that believes them lets false closures pass.
  double covariance_scale = 1.0;
};

// Compares each closure with those that have both ends near its own: among the nodes that the
// constraints without the mark `robust` tie closest to them, and with a bounded number of those. So
// the comparisons are linear in the closures whatever the graph is; finding the nearest nodes costs
// what PathCovariance::Search does, and is so too where no node has very many constraints.
//
// covariance_scale is twice the median over the loops of each closure with its nearest neighbour,
// against the median that chi2 should have: half of these loops may be made of false closures.
//
// Poses must be those that follow from the constraints that are not robust.
ClosureClusters FindClosureClusters(const PoseGraph& graph);

}  // namespace loci
