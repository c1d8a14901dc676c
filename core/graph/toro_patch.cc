// SPDX-License-Identifier: Apache-2.0
// Spreading residuals over paths, and settling nodes.
#include "core/graph/toro_patch.h"

#include <algorithm>

#include "core/base/check.h"
#include "core/base/math.h"

namespace loci {
namespace {

// Directions (cosine, sine) multiply like complex numbers.
Eigen::Vector2d Turned(const Eigen::Vector2d& direction, const Eigen::Vector2d& vector) {
  return {direction.x() * vector.x() - direction.y() * vector.y(),
          direction.y() * vector.x() + direction.x() * vector.y()};
}

Eigen::Vector2d TurnedBack(const Eigen::Vector2d& direction, const Eigen::Vector2d& vector) {
  return Turned({direction.x(), -direction.y()}, vector);
}

Eigen::Vector2d DirectionOf(double heading_rad) {
  return {Cos(heading_rad), Sin(heading_rad)};
}

// Cosine and sine by their series, exact to the last bit or two below the bound: most turns of a
// sweep are small, and the functions of the library would take a third of its time.
constexpr double kSmallTurnSquared = 1e-4;
Eigen::Vector2d SmallTurn(double turn_rad) {
  const double squared = turn_rad * turn_rad;
  return {1.0 - squared * (1.0 / 2.0 - squared * (1.0 / 24.0 - squared / 720.0)),
          turn_rad * (1.0 - squared * (1.0 / 6.0 - squared / 120.0))};
}

}  // namespace

void ToroPatch::Clear() {
  parent_.clear();
  theta_.clear();
  offset_.clear();
  heading_rad_.clear();
  direction_.clear();
  turn_.clear();
  constraints_.clear();
  paths_.Clear();
}

std::uint32_t ToroPatch::AddNode(std::uint32_t parent, const Pose2& parent_from_node) {
  const auto index = static_cast<std::uint32_t>(theta_.size());
  LOCI_DCHECK(parent == kNone || parent < index);
  const bool is_root = parent == kNone;
  const double parent_rad = is_root ? 0.0 : heading_rad_[parent];
  const Eigen::Vector2d parent_direction = is_root ? Eigen::Vector2d(1.0, 0.0) : direction_[parent];
  parent_.push_back(parent);
  theta_.push_back(parent_from_node.theta);
  offset_.push_back(Turned(parent_direction, parent_from_node.translation()));
  heading_rad_.push_back(parent_rad + parent_from_node.theta);
  direction_.push_back(DirectionOf(heading_rad_.back()));
  turn_.emplace_back(1.0, 0.0);
  paths_.AddNode();
  return index;
}

void ToroPatch::AddConstraint(const ToroForest::Edge& edge,
                              std::uint32_t from,
                              const ToroPath& path,
                              std::uint32_t label) {
  constraints_.push_back({from, label, edge.from_from_to.theta, edge.from_from_to.translation()});
  paths_.AddConstraint(path, edge.weights);
}

Pose2 ToroPatch::ParentFromNode(std::uint32_t node) const {
  const std::uint32_t parent = parent_[node];
  const Eigen::Vector2d translation =
      parent == kNone ? offset_[node] : TurnedBack(direction_[parent], offset_[node]);
  return {translation.x(), translation.y(), WrapAngle(theta_[node])};
}

void ToroPatch::Sweep(std::span<const double> rates) {
  LOCI_CHECK(rates.size() == constraints_.size());
  SpreadTurns(rates);
  TurnSubtrees();
  paths_.SpreadTranslations(
      rates, [this](std::size_t constraint) { return MeasuredInMap(constraint); }, offset_);
}

// The residual in (-pi, pi]. Turns by full circles go into the measurement, once, so that the
// common case needs no division.
inline double ToroPatch::TurnResidual(std::size_t constraint) {
  double& turn_rad = constraints_[constraint].turn_rad;
  const double sum = turn_rad + paths_.Difference(constraint, theta_, 0.0);
  const double wrapped = WrapAngle(sum);
  turn_rad += wrapped - sum;
  return wrapped;
}

inline Eigen::Vector2d ToroPatch::MeasuredInMap(std::size_t constraint) const {
  return Turned(direction_[constraints_[constraint].from], constraints_[constraint].offset);
}

void ToroPatch::SpreadTurns(std::span<const double> rates) {
  for (std::size_t i = 0; i < constraints_.size(); ++i) {
    const double share = paths_.RotationShare(i, rates[i]);
    if (share != 0.0) {
      paths_.Spread(i, share * TurnResidual(i), paths_.rotation_compliance(), theta_);
    }
  }
}

// Brings headings up to date with theta_, and turns each node's offset as far as its parent was.
void ToroPatch::TurnSubtrees() {
  for (std::size_t i = 0; i < theta_.size(); ++i) {
    const std::uint32_t parent = parent_[i];
    double heading_rad = theta_[i];
    if (parent != kNone) {
      heading_rad += heading_rad_[parent];
      offset_[i] = Turned(turn_[parent], offset_[i]);
    }
    if (heading_rad == heading_rad_[i]) {
      turn_[i] = {1.0, 0.0};
      continue;
    }
    const double turn_rad = heading_rad - heading_rad_[i];
    if (turn_rad * turn_rad < kSmallTurnSquared) {
      turn_[i] = SmallTurn(turn_rad);
      const Eigen::Vector2d direction = Turned(turn_[i], direction_[i]);
      // One step of Newton's method keeps the length at 1.
      direction_[i] = (1.5 - 0.5 * direction.squaredNorm()) * direction;
    } else {
      const Eigen::Vector2d direction = DirectionOf(heading_rad);
      turn_[i] = TurnedBack(direction_[i], direction);
      direction_[i] = direction;
    }
    heading_rad_[i] = heading_rad;
  }
}

void ToroPatch::FindOffsetResiduals(std::vector<Eigen::Vector2d>& residuals) const {
  residuals.resize(constraints_.size());
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    residuals[i] =
        MeasuredInMap(i) + paths_.Difference(i, offset_, Eigen::Vector2d(Eigen::Vector2d::Zero()));
  }
}

void ToroPatch::Settle(std::span<const std::uint32_t> nodes,
                       const SettleOptions& options,
                       std::vector<std::uint32_t>& disturbed) {
  FindCrossings(nodes);
  turn_residual_rad_.resize(constraints_.size());
  for (std::size_t i = 0; i < constraints_.size(); ++i) {
    turn_residual_rad_[i] = TurnResidual(i);
  }
  FindOffsetResiduals(offset_before_);
  turn_before_rad_ = turn_residual_rad_;
  bool moved = true;
  for (int pass = 0; pass < options.passes_max && moved; ++pass) {
    moved = SettleTurns(nodes, options.gain_min);
  }
  TurnSubtrees();
  FindOffsetResiduals(offset_residual_);
  bool shifted = true;
  for (int pass = 0; pass < options.passes_max && shifted; ++pass) {
    shifted = SettleOffsets(nodes, options.gain_min);
  }
  FindDisturbed(options.gain_min);
  for (std::uint32_t node = 0; node < node_count(); ++node) {
    const bool at_rest = place_of_node_[node] != kNone && !moved && !shifted;
    if (is_disturbed_[node] && !at_rest) {
      disturbed.push_back(node);
    }
  }
}

void ToroPatch::FindCrossings(std::span<const std::uint32_t> nodes) {
  place_of_node_.assign(node_count(), kNone);
  for (std::uint32_t place = 0; place < nodes.size(); ++place) {
    place_of_node_[nodes[place]] = place;
  }
  crossing_begin_.assign(nodes.size() + 1, 0);
  for (std::size_t i = 0; i < constraints_.size(); ++i) {
    for (const std::uint32_t node : paths_.Nodes(i)) {
      if (place_of_node_[node] != kNone) {
        ++crossing_begin_[place_of_node_[node] + 1];
      }
    }
  }
  for (std::size_t i = 1; i < crossing_begin_.size(); ++i) {
    crossing_begin_[i] += crossing_begin_[i - 1];
  }
  crossings_.resize(crossing_begin_.back());
  // Filling moves each beginning to its end, which is the next one's beginning.
  const auto fill = [this](std::span<const std::uint32_t> half, std::uint32_t crossing) {
    for (const std::uint32_t node : half) {
      if (place_of_node_[node] != kNone) {
        crossings_[crossing_begin_[place_of_node_[node]]++] = crossing;
      }
    }
  };
  for (std::uint32_t i = 0; i < constraints_.size(); ++i) {
    fill(paths_.FromHalf(i), 2 * i + 1);
    fill(paths_.ToHalf(i), 2 * i);
  }
  for (std::size_t i = crossing_begin_.size() - 1; i > 0; --i) {
    crossing_begin_[i] = crossing_begin_[i - 1];
  }
  crossing_begin_[0] = 0;
}

inline std::span<const std::uint32_t> ToroPatch::CrossingsOf(std::size_t place) const {
  return {crossings_.data() + crossing_begin_[place],
          crossing_begin_[place + 1] - crossing_begin_[place]};
}

// d/d theta_k of the sum of w r^2 / 2 is the sum of +-w r, and its second derivative the stiffness:
// the minimum lies at -gradient / stiffness, and gains gradient^2 / stiffness of the sum of w r^2.
bool ToroPatch::SettleTurns(std::span<const std::uint32_t> nodes, double gain_min) {
  bool moved = false;
  for (std::size_t place = 0; place < nodes.size(); ++place) {
    const std::span<const std::uint32_t> crossings = CrossingsOf(place);
    double gradient = 0.0;
    for (const std::uint32_t crossing : crossings) {
      const double pull = paths_.weights(crossing / 2).rotation * turn_residual_rad_[crossing / 2];
      gradient += crossing % 2 == 1 ? pull : -pull;
    }
    const double step = -gradient * paths_.rotation_compliance()[nodes[place]];
    if (step * -gradient <= gain_min) {
      continue;
    }
    moved = true;
    theta_[nodes[place]] += step;
    for (const std::uint32_t crossing : crossings) {
      turn_residual_rad_[crossing / 2] += crossing % 2 == 1 ? step : -step;
    }
  }
  return moved;
}

bool ToroPatch::SettleOffsets(std::span<const std::uint32_t> nodes, double gain_min) {
  bool moved = false;
  for (std::size_t place = 0; place < nodes.size(); ++place) {
    const std::span<const std::uint32_t> crossings = CrossingsOf(place);
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    for (const std::uint32_t crossing : crossings) {
      const double weight = paths_.weights(crossing / 2).translation;
      gradient += (crossing % 2 == 1 ? weight : -weight) * offset_residual_[crossing / 2];
    }
    const Eigen::Vector2d step = -paths_.translation_compliance()[nodes[place]] * gradient;
    if (-step.dot(gradient) <= gain_min) {
      continue;
    }
    moved = true;
    offset_[nodes[place]] += step;
    for (const std::uint32_t crossing : crossings) {
      offset_residual_[crossing / 2] += crossing % 2 == 1 ? step : Eigen::Vector2d(-step);
    }
  }
  return moved;
}

// A constraint that pulls harder by f than before would move a node by f / stiffness, which gains
// f^2 / stiffness.
void ToroPatch::FindDisturbed(double gain_min) {
  is_disturbed_.assign(node_count(), false);
  for (std::size_t i = 0; i < constraints_.size(); ++i) {
    const ToroWeights& weights = paths_.weights(i);
    const double turn_pull = weights.rotation * (turn_residual_rad_[i] - turn_before_rad_[i]);
    const double offset_pull =
        weights.translation * (offset_residual_[i] - offset_before_[i]).norm();
    for (const std::uint32_t node : paths_.Nodes(i)) {
      if (turn_pull * turn_pull * paths_.rotation_compliance()[node] > gain_min ||
          offset_pull * offset_pull * paths_.translation_compliance()[node] > gain_min) {
        is_disturbed_[node] = true;
      }
    }
  }
}

}  // namespace loci
