// SPDX-License-Identifier: Apache-2.0
// Paths of constraints through a spanning tree, and how residuals are spread over them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/graph/toro_tree.h"

namespace loci {

// How hard a constraint pulls, or how hard it is to turn and to shift a node against its parent:
// the sum over all constraints through the node.
struct ToroWeights {
  double rotation = 0.0;     // 1 / rad^2
  double translation = 0.0;  // 1 / m^2, the mean of all directions: the same in every frame

  ToroWeights& operator+=(const ToroWeights& other) {
    rotation += other.rotation;
    translation += other.translation;
    return *this;
  }
};

// `information` with the kTranslations directions of translation first.
template <int kTranslations, int kSize>
ToroWeights ToroWeightsFrom(const Eigen::Matrix<double, kSize, kSize>& information) {
  return {information.diagonal().template tail<kSize - kTranslations>().mean(),
          information.diagonal().template head<kTranslations>().mean()};
}

// Both halves of a constraint's path, each from its end upwards and without the top, where the ways
// of both ends to the root meet. Where the ends hang below two roots, which happens if both are
// fixed, the top is the map, and each half ends with its root.
struct ToroPath {
  std::vector<std::uint32_t> from_half;
  std::vector<std::uint32_t> to_half;
  std::uint32_t top_depth = 0;
};

// Overwrites `path`, whose memory is used again. `parent_of` and `depth_of` take a node; parents of
// roots are ToroTree::kNone, and their depth is 0.
template <typename ParentOf, typename DepthOf>
void FindToroPath(const NodePair& ends,
                  const ParentOf& parent_of,
                  const DepthOf& depth_of,
                  ToroPath& path) {
  path.from_half.clear();
  path.to_half.clear();
  std::uint32_t a = ends.from;
  std::uint32_t b = ends.to;
  while (a != b) {
    const bool climb_a = depth_of(a) >= depth_of(b);
    std::uint32_t& deeper = climb_a ? a : b;
    (climb_a ? path.from_half : path.to_half).push_back(deeper);
    if (parent_of(deeper) == ToroTree::kNone) {  // then the other end has come to its root, too
      path.to_half.push_back(b);
      break;
    }
    deeper = parent_of(deeper);
  }
  path.top_depth = depth_of(a);
}

// The paths of many constraints, one after the other in one array, in the plane or in space.
//
// A node's compliance is 1 / stiffness. A constraint spreads its residual over its path in
// proportion to the compliances: the gradient of w r^2 / 2 is w r for every node of the path, and
// 1 / stiffness is the diagonal of the Hessian's inverse with which RSS 2007 preconditions it.
class ToroPaths {
 public:
  void Clear();

  // Nodes get the indices 0, 1, 2 .. A node does not move until it has been given a stiffness.
  void AddNode();
  void SetStiffness(std::uint32_t node, const ToroWeights& stiffness);

  // Constraints get the indices 0, 1, 2 .. and come after their nodes and their stiffness.
  void AddConstraint(const ToroPath& path, const ToroWeights& weights);

  std::size_t constraint_count() const { return constraints_.size(); }
  std::size_t element_count() const { return nodes_.size(); }
  bool Moves(std::uint32_t node) const { return rotation_compliance_[node] > 0.0; }
  const ToroWeights& weights(std::size_t constraint) const {
    return constraints_[constraint].weights;
  }
  const std::vector<double>& rotation_compliance() const { return rotation_compliance_; }
  const std::vector<double>& translation_compliance() const { return translation_compliance_; }

  std::span<const std::uint32_t> FromHalf(std::size_t constraint) const {
    const Constraint& c = constraints_[constraint];
    return {nodes_.data() + c.begin, c.middle - c.begin};
  }
  std::span<const std::uint32_t> ToHalf(std::size_t constraint) const {
    const Constraint& c = constraints_[constraint];
    return {nodes_.data() + c.middle, c.end - c.middle};
  }

  // Both halves.
  std::span<const std::uint32_t> Nodes(std::size_t constraint) const {
    const Constraint& c = constraints_[constraint];
    return {nodes_.data() + c.begin, c.end - c.begin};
  }

  // What a constraint hands to each node of its path, per compliance of the node and residual. At
  // the full part the residual vanishes. rate * weight alone would be the step along the gradient;
  // it overshoots where the path is long and soft.
  double RotationShare(std::size_t constraint, double rate) const {
    const Constraint& c = constraints_[constraint];
    return Share(rate, c.weights.rotation, c.rotation_compliance);
  }
  double TranslationShare(std::size_t constraint, double rate) const {
    const Constraint& c = constraints_[constraint];
    return Share(rate, c.weights.translation, c.translation_compliance);
  }

  // The sum of the nodes' values over the half of `from`, minus that over the half of `to`.
  template <typename Value>
  Value Difference(std::size_t constraint, const std::vector<Value>& values, Value zero) const {
    const Value up = Sum(FromHalf(constraint), values.data(), zero);
    const Value down = Sum(ToHalf(constraint), values.data(), zero);
    return up - down;
  }

  // Takes from Difference, over all nodes of the path, `per_compliance` times their compliance.
  template <typename Value>
  void Spread(std::size_t constraint,
              const Value& per_compliance,
              const std::vector<double>& compliances,
              std::vector<Value>& values) const {
    const Value opposite = -per_compliance;
    AddShares(FromHalf(constraint), opposite, compliances.data(), values.data());
    AddShares(ToHalf(constraint), per_compliance, compliances.data(), values.data());
  }

  // Spreads the translation of every constraint whose rate is not 0. `offsets` are those of nodes
  // from their parents, and measured_in_map(constraint) the measured one, all in the map's frame.
  template <typename Vector, typename MeasuredInMap>
  void SpreadTranslations(std::span<const double> rates,
                          const MeasuredInMap& measured_in_map,
                          std::vector<Vector>& offsets) const {
    for (std::size_t i = 0; i < constraints_.size(); ++i) {
      const double share = TranslationShare(i, rates[i]);
      if (share != 0.0) {
        const Vector residual = measured_in_map(i) + Difference(i, offsets, Vector(Vector::Zero()));
        const Vector per_compliance = share * residual;
        Spread(i, per_compliance, translation_compliance_, offsets);
      }
    }
  }

 private:
  struct Constraint {
    // Of nodes_: [begin, middle) is the half of `from`, [middle, end) that of `to`.
    std::uint32_t begin = 0;
    std::uint32_t middle = 0;
    std::uint32_t end = 0;
    ToroWeights weights;
    double rotation_compliance = 0.0;  // sums over the path
    double translation_compliance = 0.0;
  };

  static double Share(double rate, double weight, double compliance) {
    return compliance == 0.0 ? 0.0 : std::min(1.0, rate * weight * compliance) / compliance;
  }

  // Two sums side by side, since one would wait for each addition.
  template <typename Value>
  static Value Sum(std::span<const std::uint32_t> nodes, const Value* values, Value zero) {
    Value even = zero;
    Value odd = zero;
    std::size_t k = 0;
    for (; k + 1 < nodes.size(); k += 2) {
      even += values[nodes[k]];
      odd += values[nodes[k + 1]];
    }
    if (k < nodes.size()) {
      even += values[nodes[k]];
    }
    even += odd;
    return even;
  }

  template <typename Value>
  static void AddShares(std::span<const std::uint32_t> nodes,
                        const Value& per_compliance,
                        const double* compliances,
                        Value* values) {
    for (const std::uint32_t node : nodes) {
      values[node] += compliances[node] * per_compliance;
    }
  }

  std::vector<double> rotation_compliance_;  // by node; 0 for those that do not move
  std::vector<double> translation_compliance_;
  std::vector<Constraint> constraints_;
  std::vector<std::uint32_t> nodes_;
};

}  // namespace loci
