// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/evaluation.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string_view>
#include <utility>

namespace loci {
namespace {

ErrorFigures FiguresOf(const std::vector<double>& errors) {
  ErrorFigures figures;
  for (const double error : errors) {
    figures.rms += error * error;
    figures.mean += error;
    figures.max = std::max(figures.max, error);
  }
  const auto count = static_cast<double>(errors.size());
  figures.rms = std::sqrt(figures.rms / count);
  figures.mean /= count;
  return figures;
}

// A stamp of seconds in decimals, to the nanosecond.
bool ParseStamp(std::string_view word, std::int64_t* stamp_ns) {
  const std::size_t dot = std::min(word.find('.'), word.size());
  std::int64_t seconds = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + dot, seconds);
  if (error != std::errc() || stop != word.data() + dot || std::abs(seconds) > 9'000'000'000) {
    return false;
  }
  std::int64_t rest = 0;
  for (std::size_t i = 0; i < 9; ++i) {
    const char digit = dot + 1 + i < word.size() ? word[dot + 1 + i] : '0';
    if (digit < '0' || digit > '9') {
      return false;
    }
    rest = rest * 10 + (digit - '0');
  }
  *stamp_ns = seconds * 1'000'000'000 + (word.starts_with('-') ? -rest : rest);
  return true;
}

bool ParseTumLine(std::string_view line, StampedPose2* pose) {
  std::array<double, 7> numbers = {};
  std::size_t position = 0;
  for (std::size_t i = 0; i <= numbers.size(); ++i) {
    position = std::min(line.find_first_not_of(" \t", position), line.size());
    const std::size_t end = std::min(line.find_first_of(" \t\r", position), line.size());
    const std::string_view word = line.substr(position, end - position);
    position = end;
    if (i == 0) {
      if (!ParseStamp(word, &pose->stamp_ns)) {
        return false;
      }
      continue;
    }
    const auto [stop, error] =
        std::from_chars(word.data(), word.data() + word.size(), numbers[i - 1]);
    if (error != std::errc() || stop != word.data() + word.size() ||
        !std::isfinite(numbers[i - 1])) {
      return false;
    }
  }
  const auto [x, y, z, qx, qy, qz, qw] = numbers;
  // The turn about the vertical axis.
  pose->pose = {x, y, Atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))};
  return true;
}

struct Pair {
  Pose2 estimate;
  Pose2 truth;
};

std::vector<Pair> PairUp(const std::vector<StampedPose2>& estimate,
                         const std::vector<StampedPose2>& truth,
                         std::int64_t gap_max_ns) {
  std::vector<Pair> pairs;
  for (const StampedPose2& pose : estimate) {
    const auto after = std::lower_bound(
        truth.begin(), truth.end(), pose.stamp_ns, [](const StampedPose2& a, std::int64_t stamp) {
          return a.stamp_ns < stamp;
        });
    if (after == truth.end()) {
      continue;
    }
    if (after->stamp_ns == pose.stamp_ns) {
      pairs.push_back({pose.pose, after->pose});
      continue;
    }
    if (after == truth.begin() || after->stamp_ns - (after - 1)->stamp_ns > gap_max_ns) {
      continue;
    }
    const StampedPose2& before = *(after - 1);
    const double share = static_cast<double>(pose.stamp_ns - before.stamp_ns) /
                         static_cast<double>(after->stamp_ns - before.stamp_ns);
    pairs.push_back(
        {pose.pose, before.pose * Exp(share * Log(Inverse(before.pose) * after->pose))});
  }
  return pairs;
}

Pose2 Align(const std::vector<Pair>& pairs) {
  Eigen::Vector2d mean_estimate = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_truth = Eigen::Vector2d::Zero();
  for (const Pair& pair : pairs) {
    mean_estimate += pair.estimate.translation();
    mean_truth += pair.truth.translation();
  }
  mean_estimate /= static_cast<double>(pairs.size());
  mean_truth /= static_cast<double>(pairs.size());
  double sine = 0.0;
  double cosine = 0.0;
  for (const Pair& pair : pairs) {
    const Eigen::Vector2d a = pair.estimate.translation() - mean_estimate;
    const Eigen::Vector2d b = pair.truth.translation() - mean_truth;
    cosine += a.dot(b);
    sine += a.x() * b.y() - a.y() * b.x();
  }
  const Pose2 turn = {0.0, 0.0, Atan2(sine, cosine)};
  const Eigen::Vector2d shift = mean_truth - turn * mean_estimate;
  return {shift.x(), shift.y(), turn.theta};
}

void Measure(const std::vector<Pair>& pairs,
             const Pose2& truth_from_estimate,
             ErrorFigures* translation_m,
             ErrorFigures* rotation_rad) {
  std::vector<double> distances;
  std::vector<double> turns;
  for (const Pair& pair : pairs) {
    const Pose2 error = Inverse(pair.truth) * (truth_from_estimate * pair.estimate);
    distances.push_back(error.translation().norm());
    turns.push_back(std::abs(error.theta));
  }
  *translation_m = FiguresOf(distances);
  *rotation_rad = FiguresOf(turns);
}

// Cells of one lattice that are set.
struct Mask {
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<char> set;

  std::size_t Index(std::int32_t column, std::int32_t row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(column);
  }
};

// Sets all cells at most `cells` rows and columns away from one.
void SetAround(Mask& mask, std::int32_t column, std::int32_t row, std::int32_t cells) {
  const std::int32_t column_end = std::min(mask.width - 1, column + cells);
  const std::int32_t row_end = std::min(mask.height - 1, row + cells);
  for (std::int32_t y = std::max(0, row - cells); y <= row_end; ++y) {
    for (std::int32_t x = std::max(0, column - cells); x <= column_end; ++x) {
      mask.set[mask.Index(x, y)] = 1;
    }
  }
}

Mask Dilate(const Mask& mask, std::int32_t cells) {
  Mask result = mask;
  for (std::int32_t row = 0; row < mask.height; ++row) {
    for (std::int32_t column = 0; column < mask.width; ++column) {
      if (mask.set[mask.Index(column, row)] != 0) {
        SetAround(result, column, row, cells);
      }
    }
  }
  return result;
}

// The union of both maps' boxes in the truth's lattice.
struct Frame {
  std::int32_t column_min = 0;  // of the truth's lattice
  std::int32_t row_min = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
};

std::int32_t CellAt(double at_m, double min_m, double resolution_m) {
  return static_cast<std::int32_t>(std::floor((at_m - min_m) / resolution_m));
}

StatusOr<Frame> FrameOf(const OccupancyMap& estimate, const OccupancyMap& truth) {
  const double r = truth.resolution_m;
  const double columns = (estimate.x_min_m - truth.x_min_m) / r;
  const double rows = (estimate.y_min_m - truth.y_min_m) / r;
  constexpr double kFarCells = 1e5;
  if (!(std::abs(columns) < kFarCells) || !(std::abs(rows) < kFarCells)) {
    return InvalidArgumentError("the grids lie more than " +
                                std::to_string(static_cast<int>(kFarCells)) + " cells apart");
  }
  constexpr std::int32_t kMargin = 3;  // for dilation
  Frame frame;
  frame.column_min = std::min(0, static_cast<std::int32_t>(std::floor(columns))) - kMargin;
  frame.row_min = std::min(0, static_cast<std::int32_t>(std::floor(rows))) - kMargin;
  frame.width = std::max(truth.width, static_cast<std::int32_t>(columns) + estimate.width + 1) -
                frame.column_min + kMargin;
  frame.height = std::max(truth.height, static_cast<std::int32_t>(rows) + estimate.height + 1) -
                 frame.row_min + kMargin;
  return frame;
}

template <typename Predicate>
Mask MaskOf(const OccupancyMap& map,
            const OccupancyMap& truth,
            const Frame& frame,
            const Predicate& wanted) {
  Mask mask;
  mask.width = frame.width;
  mask.height = frame.height;
  mask.set.assign(static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height),
                  0);
  for (std::int32_t row = 0; row < map.height; ++row) {
    for (std::int32_t column = 0; column < map.width; ++column) {
      if (wanted(map.at(column, row))) {
        const double x = map.x_min_m + (column + 0.5) * map.resolution_m;
        const double y = map.y_min_m + (row + 0.5) * map.resolution_m;
        mask.set[mask.Index(CellAt(x, truth.x_min_m, truth.resolution_m) - frame.column_min,
                            CellAt(y, truth.y_min_m, truth.resolution_m) - frame.row_min)] = 1;
      }
    }
  }
  return mask;
}

double Share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

StatusOr<std::vector<StampedPose2>> ReadTumFile(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    return NotFoundError(path + ": cannot be read");
  }
  std::vector<StampedPose2> poses;
  std::size_t number = 0;
  for (std::string line; std::getline(file, line);) {
    ++number;
    const std::size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string::npos || line[begin] == '#') {
      continue;
    }
    StampedPose2 pose;
    if (!ParseTumLine(line, &pose)) {
      return InvalidArgumentError(path + ":" + std::to_string(number) +
                                  ": must be stamp x y z qx qy qz qw");
    }
    poses.push_back(pose);
  }
  std::stable_sort(poses.begin(), poses.end(), [](const StampedPose2& a, const StampedPose2& b) {
    return a.stamp_ns < b.stamp_ns;
  });
  return poses;
}

StatusOr<TrajectoryErrors> CompareTrajectories(const std::vector<StampedPose2>& estimate,
                                               const std::vector<StampedPose2>& truth,
                                               std::int64_t gap_max_ns) {
  const std::vector<Pair> pairs = PairUp(estimate, truth, gap_max_ns);
  if (pairs.size() < 2) {
    return InvalidArgumentError(
        "the trajectories have " + std::to_string(pairs.size()) +
        " stamps in common, must be at least 2; are they of the same session?");
  }
  TrajectoryErrors errors;
  errors.pair_count = pairs.size();
  errors.unmatched_count = estimate.size() - pairs.size();
  errors.truth_from_estimate = Align(pairs);
  Measure(pairs, Pose2(), &errors.translation_m, &errors.rotation_rad);
  Measure(pairs,
          errors.truth_from_estimate,
          &errors.aligned_translation_m,
          &errors.aligned_rotation_rad);
  return errors;
}

StatusOr<GridAgreement> CompareGrids(const OccupancyMap& estimate, const OccupancyMap& truth) {
  if (std::abs(estimate.resolution_m / truth.resolution_m - 1.0) > 0.01) {
    return InvalidArgumentError("resolution: " + std::to_string(estimate.resolution_m) + " and " +
                                std::to_string(truth.resolution_m) + " m, must be the same");
  }
  LOCI_ASSIGN_OR_RETURN(const Frame frame, FrameOf(estimate, truth));
  using Cell = OccupancyMap::Cell;
  const auto occupied = [](Cell cell) { return cell == Cell::kOccupied; };
  const Mask found = MaskOf(estimate, truth, frame, occupied);
  const Mask real = MaskOf(truth, truth, frame, occupied);
  const Mask observed =
      Dilate(MaskOf(estimate, truth, frame, [](Cell cell) { return cell != Cell::kUnknown; }), 1);
  const Mask found_wide = Dilate(found, 1);
  const Mask real_wide = Dilate(real, 1);
  std::size_t both = 0;
  std::size_t either = 0;
  std::size_t either_everywhere = 0;
  std::size_t found_right = 0;
  std::size_t real_found = 0;
  GridAgreement agreement;
  for (std::size_t i = 0; i < found.set.size(); ++i) {
    const bool in_either = (found_wide.set[i] | real_wide.set[i]) != 0;
    const bool in_both = (found_wide.set[i] & real_wide.set[i]) != 0;
    const bool seen = observed.set[i] != 0;
    both += in_both && seen ? 1U : 0U;
    either += in_either && seen ? 1U : 0U;
    either_everywhere += in_either ? 1U : 0U;
    agreement.occupied_estimate += found.set[i] != 0 ? 1U : 0U;
    found_right += found.set[i] != 0 && real_wide.set[i] != 0 ? 1U : 0U;
    agreement.occupied_truth += real.set[i] != 0 && seen ? 1U : 0U;
    real_found += real.set[i] != 0 && seen && found_wide.set[i] != 0 ? 1U : 0U;
  }
  if (agreement.occupied_estimate == 0 || either == 0) {
    return InvalidArgumentError("a grid has no occupied cell to compare");
  }
  agreement.iou = Share(both, either);
  agreement.iou_everywhere = Share(both, either_everywhere);
  agreement.precision = Share(found_right, agreement.occupied_estimate);
  agreement.recall = Share(real_found, agreement.occupied_truth);
  return agreement;
}

}  // namespace loci
