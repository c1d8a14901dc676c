// SPDX-License-Identifier: Apache-2.0
#include "core/matching/wide_search.h"

#include <algorithm>
#include <cmath>

namespace loci {
namespace {

std::int32_t StepCount(double half, double step) {
  return static_cast<std::int32_t>(std::floor(half / step + 1e-9));
}

double Square(double value) {
  return value * value;
}

// Distance of 0 from the interval [low, high].
std::int32_t DistanceFromZero(std::int32_t low, std::int32_t high) {
  return low > 0 ? low : (high < 0 ? -high : 0);
}

}  // namespace

// A square of 2^level x 2^level translations at one heading.
struct WideSearch::Node {
  double bound;
  std::int32_t theta;
  std::int32_t x;
  std::int32_t y;
  int level;
};

// One search: depth first, the most promising square first.
class WideSearch::Run {
 public:
  Run(const WideSearch& search,
      std::span<const Eigen::Vector2d> points,
      const Pose2& predicted,
      const SearchWindow& window,
      double score_min,
      const ExcludedPoses* excluded)
      : search_(search),
        predicted_(predicted),
        window_(window),
        excluded_(excluded),
        steps_x_(StepCount(window.half_x_m, search.cell_size_m_)),
        steps_y_(StepCount(window.half_y_m, search.cell_size_m_)),
        steps_theta_(StepCount(window.half_theta_rad, window.step_theta_rad)),
        scale_(1.0 / (255.0 * static_cast<double>(std::max<std::size_t>(points.size(), 1)))),
        best_score_(score_min) {
    for (std::int32_t theta = -steps_theta_; theta <= steps_theta_; ++theta) {
      const Transformer2 transform(PoseAt(0, 0, theta));
      std::vector<CellIndex>& cells = cells_.emplace_back();
      cells.reserve(points.size());
      for (const Eigen::Vector2d& point : points) {
        const Eigen::Vector2d moved = (transform * point) / search.cell_size_m_;
        cells.push_back({static_cast<std::int32_t>(std::floor(moved.x())),
                         static_cast<std::int32_t>(std::floor(moved.y()))});
      }
    }
  }

  std::optional<CorrelativeMatch> Search() {
    std::vector<Node> roots;
    const int top = kLevelCount - 1;
    const std::int32_t side = 1 << top;
    for (std::int32_t theta = -steps_theta_; theta <= steps_theta_; ++theta) {
      for (std::int32_t y = -steps_y_; y <= steps_y_; y += side) {
        for (std::int32_t x = -steps_x_; x <= steps_x_; x += side) {
          roots.push_back({Bound(theta, x, y, top), theta, x, y, top});
        }
      }
    }
    SortByBound(roots);
    for (const Node& root : roots) {
      Visit(root);
    }
    if (!found_) {
      return std::nullopt;
    }
    return best_;
  }

 private:
  Pose2 PoseAt(std::int32_t x, std::int32_t y, std::int32_t theta) const {
    return {predicted_.x + x * search_.cell_size_m_,
            predicted_.y + y * search_.cell_size_m_,
            WrapAngle(predicted_.theta + theta * window_.step_theta_rad)};
  }

  std::uint32_t RawSum(std::int32_t theta, std::int32_t x, std::int32_t y, int level) const {
    const Level& maxima = search_.levels_[static_cast<std::size_t>(level)];
    std::uint32_t sum = 0;
    for (const CellIndex cell : cells_[static_cast<std::size_t>(theta + steps_theta_)]) {
      sum += maxima.At(cell.x + x, cell.y + y);
    }
    return sum;
  }

  // The least penalty of the square's translations.
  double PenaltyOf(std::int32_t theta, std::int32_t x, std::int32_t y, int level) const {
    const std::int32_t last = (1 << level) - 1;
    const std::int32_t dx = DistanceFromZero(x, x + last);
    const std::int32_t dy = DistanceFromZero(y, y + last);
    return window_.border_penalty * (Square(dx) / Square(std::max(steps_x_, 1)) +
                                     Square(dy) / Square(std::max(steps_y_, 1)) +
                                     Square(theta) / Square(std::max(steps_theta_, 1)));
  }

  double Bound(std::int32_t theta, std::int32_t x, std::int32_t y, int level) const {
    return scale_ * RawSum(theta, x, y, level) - PenaltyOf(theta, x, y, level);
  }

  static void SortByBound(std::vector<Node>& nodes) {
    std::stable_sort(
        nodes.begin(), nodes.end(), [](const Node& a, const Node& b) { return a.bound > b.bound; });
  }

  bool IsExcluded(const Pose2& pose) const {
    if (excluded_ == nullptr) {
      return false;
    }
    const Eigen::Vector3d difference(pose.x - excluded_->center.x,
                                     pose.y - excluded_->center.y,
                                     WrapAngle(pose.theta - excluded_->center.theta));
    return difference.dot(excluded_->information * difference) <= 1.0;
  }

  void Visit(const Node& node) {
    if (node.bound <= best_score_) {
      return;
    }
    if (node.level == 0) {
      const Pose2 pose = PoseAt(node.x, node.y, node.theta);
      if (!IsExcluded(pose)) {
        const std::uint32_t raw = RawSum(node.theta, node.x, node.y, 0);
        best_ = {pose, node.bound, scale_ * raw, raw};
        best_score_ = node.bound;
        found_ = true;
      }
      return;
    }
    std::vector<Node> children;
    const int level = node.level - 1;
    const std::int32_t half = 1 << level;
    for (const std::int32_t y : {node.y, node.y + half}) {
      for (const std::int32_t x : {node.x, node.x + half}) {
        if (x <= steps_x_ && y <= steps_y_) {
          children.push_back({Bound(node.theta, x, y, level), node.theta, x, y, level});
        }
      }
    }
    SortByBound(children);
    for (const Node& child : children) {
      Visit(child);
    }
  }

  const WideSearch& search_;
  Pose2 predicted_;
  SearchWindow window_;
  const ExcludedPoses* excluded_;
  std::int32_t steps_x_;
  std::int32_t steps_y_;
  std::int32_t steps_theta_;
  double scale_;
  std::vector<std::vector<CellIndex>> cells_;  // by heading
  double best_score_;
  bool found_ = false;
  CorrelativeMatch best_;
};

WideSearch::WideSearch(const LikelihoodGrid& grid) : cell_size_m_(grid.cell_size_m()) {
  Level base;
  base.first = grid.box().min;
  base.width = grid.width();
  base.height = grid.height();
  base.bytes.assign(
      grid.bytes(),
      grid.bytes() + static_cast<std::size_t>(base.width) * static_cast<std::size_t>(base.height));
  levels_.push_back(std::move(base));
  for (int level = 1; level < kLevelCount; ++level) {
    // A square of 2 s cells is four squares of s cells; those that begin before the grid count too.
    const Level& finer = levels_.back();
    const std::int32_t s = 1 << (level - 1);
    Level coarser;
    coarser.first = {finer.first.x - s, finer.first.y - s};
    coarser.width = finer.width + s;
    coarser.height = finer.height + s;
    coarser.bytes.resize(static_cast<std::size_t>(coarser.width) *
                         static_cast<std::size_t>(coarser.height));
    const std::size_t width = static_cast<std::size_t>(coarser.width);
    const std::size_t finer_width = static_cast<std::size_t>(finer.width);
    const std::size_t shift = static_cast<std::size_t>(s);
    // Each finer row goes, as it is and shifted, into its own coarser row and the one s below.
    for (std::size_t row = 0; row < static_cast<std::size_t>(finer.height); ++row) {
      const std::uint8_t* from = &finer.bytes[row * finer_width];
      for (const std::size_t to_row : {row + shift, row}) {
        std::uint8_t* to = &coarser.bytes[to_row * width];
        for (std::size_t x = 0; x < finer_width; ++x) {
          to[x] = std::max(to[x], from[x]);
        }
        for (std::size_t x = 0; x < finer_width; ++x) {
          to[x + shift] = std::max(to[x + shift], from[x]);
        }
      }
    }
    levels_.push_back(std::move(coarser));
  }
}

std::optional<CorrelativeMatch> WideSearch::FindBest(std::span<const Eigen::Vector2d> points,
                                                     const Pose2& predicted,
                                                     const SearchWindow& window,
                                                     double score_min,
                                                     const ExcludedPoses* excluded) const {
  return Run(*this, points, predicted, window, score_min, excluded).Search();
}

}  // namespace loci
