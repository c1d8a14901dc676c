// SPDX-License-Identifier: Apache-2.0
// Loops of two closures each, and the sets that agree.
#include "core/graph/closure_clusters.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>

#include "core/graph/consistent_set.h"
#include "core/graph/graph_selection.h"

namespace loci {
namespace {

// Ends of closures that are compared are among so many nodes: 20 to either side on a path. Further
// apart, compounded errors tell less and less.
constexpr std::size_t kNearNodes = 41;
// A closure is compared with so many others at most, the nearest ones: enough to hang together.
constexpr std::size_t kComparedMax = 64;
// Those are looked for among so many, at the nearest ends first: of many copies of one
// closure each would look at all others.
constexpr std::size_t kGatheredMax = 2048;
// Two closures that agree by chance with more than this probability say nothing about each other.
constexpr double kChanceMax = 0.05;
// The median of chi2 with three degrees of freedom.
constexpr double kMedianChi2 = 2.366;
// The median of fewer loops says nothing.
constexpr std::size_t kLoopsMin = 10;
// Loops see the noise of their few constraints only, and false closures may agree better than true
// ones do: twice what they say.
constexpr double kScaleMargin = 2.0;
constexpr double kScaleMin = 1e-6;  // errors of rounding have no covariance
constexpr double kAreaMinM2 = 1.0;  // closures without a translation are still apart
// The part of the coordinates that counts as far out, at either side; at least one of so many.
constexpr double kFarOutPart = 0.05;
constexpr std::size_t kFarOutCountMin = 5;

constexpr Discrepancy kFitsNothing{std::numeric_limits<double>::infinity(),
                                   std::numeric_limits<double>::infinity()};

struct Loop {
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  Discrepancy discrepancy;
};

Eigen::Matrix3d Moved(const Eigen::Matrix3d& covariance, const Pose2& new_from_old) {
  const Eigen::Matrix3d adjoint = Adjoint(new_from_old);
  return adjoint * covariance * adjoint.transpose();
}

Discrepancy DiscrepancyOf(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance) {
  const Eigen::LLT<Eigen::Matrix3d> factor(covariance);
  const Eigen::Matrix3d root = factor.matrixL();
  const Eigen::Vector3d whitened = factor.matrixL().solve(error);
  const Discrepancy result{whitened.squaredNorm(), root(0, 0) * root(1, 1) * root(2, 2)};
  // Measurements beyond the range of numbers fit nothing. What is not a number has no order,
  // either.
  return std::isfinite(result.chi2) && std::isfinite(result.sigma_product) ? result : kFitsNothing;
}

// The closures near one closure, nearest first.
class NearClosures {
 public:
  NearClosures(const PoseGraph& graph, const std::vector<Closure>& closures)
      : closures_(closures), near_a_(graph), near_b_(graph), rank_b_(graph.map_from_node.size()) {
    const std::vector<bool> trusted = TrustedOf(graph).constraints;
    near_a_.Use(trusted);
    near_b_.Use(trusted);
  }

  // Those behind `closure` in the order of closures, so that every pair is found once. Looks at
  // kGatheredMax at most.
  std::vector<std::uint32_t> Behind(std::uint32_t closure) {
    const Closure& at = closures_[closure];
    near_a_.Search(at.a, kNearNodes);
    near_b_.Search(at.b, kNearNodes);
    for (std::uint32_t i = 0; i < near_b_.Found().size(); ++i) {
      rank_b_[near_b_.Found()[i]] = i;
    }
    const auto behind = closures_.begin() + static_cast<std::ptrdiff_t>(closure) + 1;
    std::vector<std::pair<std::size_t, std::uint32_t>> ranked;
    std::size_t looked_at = 0;
    for (std::size_t rank_a = 0; rank_a < near_a_.Found().size(); ++rank_a) {
      const std::uint32_t a = near_a_.Found()[rank_a];
      auto other =
          std::lower_bound(behind, closures_.end(), a, [](const Closure& each, std::uint32_t node) {
            return each.a < node;
          });
      for (; other != closures_.end() && other->a == a && looked_at < kGatheredMax; ++other) {
        ++looked_at;
        if (near_b_.IsFound(other->b)) {
          ranked.emplace_back(rank_a + rank_b_[other->b],
                              static_cast<std::uint32_t>(other - closures_.begin()));
        }
      }
    }
    const std::size_t count = std::min(ranked.size(), kComparedMax);
    std::partial_sort(
        ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(count), ranked.end());
    ranked.resize(count);
    std::vector<std::uint32_t> result;
    for (const auto& [rank, index] : ranked) {
      result.push_back(index);
    }
    return result;
  }

  const PathCovariance& near_a() const { return near_a_; }
  const PathCovariance& near_b() const { return near_b_; }

 private:
  const std::vector<Closure>& closures_;
  PathCovariance near_a_;
  PathCovariance near_b_;
  std::vector<std::size_t> rank_b_;
};

// Every closure's loops with those behind it, the nearest first.
std::vector<Loop> FindLoops(const PoseGraph& graph, const std::vector<Closure>& closures) {
  NearClosures near(graph, closures);
  const auto relation = [&](const PathCovariance& paths, std::uint32_t from, std::uint32_t to) {
    return Relation{Inverse(graph.map_from_node[from]) * graph.map_from_node[to],
                    paths.CovarianceTo(to)};
  };
  std::vector<Loop> loops;
  for (std::uint32_t i = 0; i < closures.size(); ++i) {
    for (const std::uint32_t j : near.Behind(i)) {
      const Closure& first = closures[i];
      const Closure& second = closures[j];
      loops.push_back({i,
                       j,
                       CompareClosures(first,
                                       second,
                                       relation(near.near_a(), first.a, second.a),
                                       relation(near.near_b(), first.b, second.b))});
    }
  }
  return loops;
}

// Twice the median of the loops with the nearest neighbour, against what it should be.
double CovarianceScale(const std::vector<Loop>& loops) {
  std::vector<double> nearest;
  for (std::size_t i = 0; i < loops.size(); ++i) {
    if (i == 0 || loops[i].first != loops[i - 1].first) {
      nearest.push_back(loops[i].discrepancy.chi2);
    }
  }
  if (nearest.size() < kLoopsMin) {
    return 1.0;
  }
  const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  return std::clamp(kScaleMargin * *middle / kMedianChi2, kScaleMin, 1.0);
}

// Where the measured translations are.
double AreaOfTranslations(const std::vector<Closure>& closures) {
  std::vector<Eigen::Vector2d> translations;
  for (const Closure& closure : closures) {
    translations.push_back(closure.a_from_b.translation());
  }
  return AreaOf(translations);
}

// From the lowest to the highest of what is not far out, and what is far out by the same measure.
double SpreadOf(std::vector<double> coordinates) {
  const std::size_t count = coordinates.size();
  if (count < 2) {
    return 0.0;
  }
  const std::size_t far_out =
      count < kFarOutCountMin
          ? 0
          : static_cast<std::size_t>(std::ceil(kFarOutPart * static_cast<double>(count)));
  const auto low = coordinates.begin() + static_cast<std::ptrdiff_t>(far_out);
  const auto high = coordinates.end() - static_cast<std::ptrdiff_t>(far_out + 1);
  std::nth_element(coordinates.begin(), low, coordinates.end());
  const double lowest = *low;
  std::nth_element(low, high, coordinates.end());
  return (*high - lowest) * static_cast<double>(count - 1) /
         static_cast<double>(count - 1 - 2 * far_out);
}

}  // namespace

std::vector<Closure> ClosuresOf(const PoseGraph& graph) {
  const std::vector<std::uint32_t> component =
      FindComponents(PartOf(graph, TrustedOf(graph))).of_node;
  std::vector<Closure> closures;
  for (std::uint32_t i = 0; i < graph.constraints.size(); ++i) {
    const GraphConstraint& constraint = graph.constraints[i];
    const Eigen::LLT<Eigen::Matrix3d> factor(constraint.information);
    if (!constraint.robust || factor.info() != Eigen::Success) {
      continue;
    }
    Closure closure{i,
                    constraint.from,
                    constraint.to,
                    constraint.from_from_to,
                    factor.solve(Eigen::Matrix3d::Identity())};
    if (!closure.covariance.allFinite()) {
      continue;
    }
    if (std::tie(component[closure.a], closure.a) > std::tie(component[closure.b], closure.b)) {
      std::swap(closure.a, closure.b);
      closure.covariance = Moved(closure.covariance, closure.a_from_b);
      closure.a_from_b = Inverse(closure.a_from_b);
    }
    closures.push_back(closure);
  }
  std::sort(closures.begin(), closures.end(), [](const Closure& x, const Closure& y) {
    return std::tie(x.a, x.b, x.constraint) < std::tie(y.a, y.b, y.constraint);
  });
  return closures;
}

// The first closure, carried to the second's ends, is Inverse(a_side) * first * b_side; the errors
// of the three are moved to its right.
Discrepancy CompareClosures(const Closure& first,
                            const Closure& second,
                            const Relation& a_side,
                            const Relation& b_side) {
  const Pose2 carried = Inverse(a_side.from_from_to) * first.a_from_b * b_side.from_from_to;
  const Eigen::Vector3d error = (Inverse(second.a_from_b) * carried).vector();
  const Eigen::Matrix3d covariance = second.covariance + b_side.covariance +
                                     Moved(first.covariance, Inverse(b_side.from_from_to)) +
                                     Moved(a_side.covariance, Inverse(carried));
  return DiscrepancyOf(error, covariance);
}

Discrepancy CompareClosure(const Closure& closure, const Relation& predicted_a_from_b) {
  return DiscrepancyOf((Inverse(closure.a_from_b) * predicted_a_from_b.from_from_to).vector(),
                       closure.covariance + predicted_a_from_b.covariance);
}

double ChanceOf(const Discrepancy& discrepancy, double covariance_scale, double area_m2) {
  const double ball = 4.0 / 3.0 * kPi * kGateChi2 * std::sqrt(kGateChi2);
  const double sigma_product =
      covariance_scale * std::sqrt(covariance_scale) * discrepancy.sigma_product;
  return ball * sigma_product / (area_m2 * 2.0 * kPi);
}

double AreaOf(const std::vector<Eigen::Vector2d>& positions) {
  std::vector<double> x;
  std::vector<double> y;
  for (const Eigen::Vector2d& position : positions) {
    x.push_back(position.x());
    y.push_back(position.y());
  }
  return std::max(kAreaMinM2, SpreadOf(std::move(x)) * SpreadOf(std::move(y)));
}

ClosureClusters FindClosureClusters(const PoseGraph& graph) {
  ClosureClusters result;
  result.closures = ClosuresOf(graph);
  const std::vector<Loop> loops = FindLoops(graph, result.closures);
  result.covariance_scale = CovarianceScale(loops);
  const double scale = result.covariance_scale;
  const double area_m2 = AreaOfTranslations(result.closures);
  ConsistencyGraph consistency;
  consistency.weights.assign(result.closures.size(), 1.0);
  for (const Loop& loop : loops) {
    if (loop.discrepancy.chi2 > kGateChi2 * scale) {
      consistency.conflicts.emplace_back(loop.first, loop.second);
    } else if (ChanceOf(loop.discrepancy, scale, area_m2) < kChanceMax) {
      consistency.links.emplace_back(loop.first, loop.second);
    }
  }
  result.clusters = ConsistentSets(consistency);
  std::stable_sort(result.clusters.begin(),
                   result.clusters.end(),
                   [](const auto& x, const auto& y) { return x.size() > y.size(); });
  return result;
}

}  // namespace loci
