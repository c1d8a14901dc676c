// SPDX-License-Identifier: Apache-2.0
// Building of the array of paths.
#include "core/graph/toro_paths.h"

namespace loci {
namespace {

// Stiffness that a zero information is taken for, so that shares stay finite.
constexpr double kStiffnessMin = 1e-12;

}  // namespace

void ToroPaths::Clear() {
  rotation_compliance_.clear();
  translation_compliance_.clear();
  constraints_.clear();
  nodes_.clear();
}

void ToroPaths::AddNode() {
  rotation_compliance_.push_back(0.0);
  translation_compliance_.push_back(0.0);
}

void ToroPaths::SetStiffness(std::uint32_t node, const ToroWeights& stiffness) {
  rotation_compliance_[node] = 1.0 / std::max(kStiffnessMin, stiffness.rotation);
  translation_compliance_[node] = 1.0 / std::max(kStiffnessMin, stiffness.translation);
}

void ToroPaths::AddConstraint(const ToroPath& path, const ToroWeights& weights) {
  Constraint constraint;
  constraint.begin = static_cast<std::uint32_t>(nodes_.size());
  nodes_.insert(nodes_.end(), path.from_half.begin(), path.from_half.end());
  constraint.middle = static_cast<std::uint32_t>(nodes_.size());
  nodes_.insert(nodes_.end(), path.to_half.begin(), path.to_half.end());
  constraint.end = static_cast<std::uint32_t>(nodes_.size());
  constraint.weights = weights;
  for (std::uint32_t k = constraint.begin; k < constraint.end; ++k) {
    constraint.rotation_compliance += rotation_compliance_[nodes_[k]];
    constraint.translation_compliance += translation_compliance_[nodes_[k]];
  }
  constraints_.push_back(constraint);
}

}  // namespace loci
