// SPDX-License-Identifier: Apache-2.0
#include "core/closure/place_match.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <Eigen/LU>

#include "core/matching/correlative_search.h"
#include "core/matching/likelihood_grid.h"
#include "core/matching/line_registration.h"
#include "core/matching/scrim.h"
#include "core/matching/wide_search.h"

namespace loci {
namespace {

constexpr std::uint32_t kHitsMin = 2;
constexpr std::size_t kSearchPoints = 300;  // enough for the search, which registration follows
constexpr std::size_t kRegistrationPoints = 600;
constexpr double kWindowMinM = 0.3;
constexpr double kWindowMinRad = 0.1;
constexpr double kWindowMaxRad = 0.7;
constexpr double kStepRad = 0.014;
// Less than this mean likelihood is no match at all, whatever the tests would say.
constexpr double kScoreMin = 0.3;
// The registration must stay near the search's result, or it slid somewhere else.
constexpr double kSlideMaxM = 0.3;
// A second peak lies further from the first than the first's own width.
constexpr double kPeakRadiusM = 0.3;
constexpr double kPeakRadiusRad = 0.15;

std::vector<Eigen::Vector2d> Thinned(const std::vector<Eigen::Vector2d>& points,
                                     std::size_t count_max) {
  const std::size_t step = std::max<std::size_t>(1, (points.size() + count_max - 1) / count_max);
  std::vector<Eigen::Vector2d> thinned;
  for (std::size_t i = 0; i < points.size(); i += step) {
    thinned.push_back(points[i]);
  }
  return thinned;
}

SearchWindow WindowOf(const PlacePrediction& prediction, const ClosureLimits& limits) {
  // Covariance of the translation along the axes of `from`.
  const Transformer2 rotation({0.0, 0.0, prediction.from_from_to.theta});
  Eigen::Matrix2d turn;
  turn << rotation.Rotate(Eigen::Vector2d::UnitX()), rotation.Rotate(Eigen::Vector2d::UnitY());
  const Eigen::Matrix2d translation =
      turn * prediction.covariance.topLeftCorner<2, 2>() * turn.transpose();
  SearchWindow window;
  window.half_x_m =
      std::clamp(3.0 * std::sqrt(translation(0, 0)), kWindowMinM, limits.window_max_m);
  window.half_y_m =
      std::clamp(3.0 * std::sqrt(translation(1, 1)), kWindowMinM, limits.window_max_m);
  window.half_theta_rad =
      std::clamp(3.0 * std::sqrt(prediction.covariance(2, 2)), kWindowMinRad, kWindowMaxRad);
  window.step_theta_rad = kStepRad;
  return window;
}

// The area around the best pose in which other poses belong to the same peak: its 3-sigma ellipse,
// widened by the width of a peak.
ExcludedPoses EllipseAround(const PlaceMatch& match, const Pose2& searched) {
  const Transformer2 rotation({0.0, 0.0, match.from_from_to.theta});
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  turn.col(0).head<2>() = rotation.Rotate(Eigen::Vector2d::UnitX());
  turn.col(1).head<2>() = rotation.Rotate(Eigen::Vector2d::UnitY());
  Eigen::Matrix3d extent = 9.0 * turn * match.covariance.matrix() * turn.transpose();
  extent(0, 0) += kPeakRadiusM * kPeakRadiusM;
  extent(1, 1) += kPeakRadiusM * kPeakRadiusM;
  extent(2, 2) += kPeakRadiusRad * kPeakRadiusRad;
  return {searched, extent.inverse()};
}

std::string Percent(double fraction) {
  char text[16];
  std::snprintf(text, sizeof(text), "%.1f %%", 100.0 * fraction);
  return text;
}

std::string JudgeAgreement(const Agreement& agreement, const ClosureLimits& limits) {
  if (agreement.overlap_m2 < limits.overlap_min_m2) {
    return "overlap " + std::to_string(agreement.overlap_m2) + " m2, needs " +
           std::to_string(limits.overlap_min_m2);
  }
  if (agreement.hausdorff_fraction < limits.hausdorff_fraction_min) {
    return "only " + Percent(agreement.hausdorff_fraction) + " of the points agree";
  }
  if (agreement.free_conflict_fraction > limits.free_conflict_fraction_max) {
    return Percent(agreement.free_conflict_fraction) + " of the points lie in free space";
  }
  return "";
}

}  // namespace

std::optional<PlaceMatch> MatchPlaces(const Place& from,
                                      const Place& to,
                                      const PlacePrediction& prediction,
                                      const ClosureLimits& limits,
                                      std::uint64_t seed) {
  const std::vector<Eigen::Vector2d> means = to.patch.Means(kHitsMin);
  const std::vector<Eigen::Vector2d> search_points = Thinned(means, kSearchPoints);
  if (search_points.size() < 20) {
    return std::nullopt;
  }
  const LikelihoodGrid grid = LikelihoodGrid::OfPatch(from.patch, kHitsMin);
  const WideSearch search(grid);
  const SearchWindow window = WindowOf(prediction, limits);
  const std::optional<CorrelativeMatch> found =
      search.FindBest(search_points, prediction.from_from_to, window, kScoreMin, nullptr);
  if (!found.has_value()) {
    return std::nullopt;
  }
  const std::vector<Eigen::Vector2d> points = Thinned(means, kRegistrationPoints);
  const Registration registration =
      RegisterToLines(points, found->grid_from_robot, from.patch, RegistrationOptions());
  const Pose2 slide = Inverse(found->grid_from_robot) * registration.patch_from_robot;
  if (slide.translation().norm() > kSlideMaxM) {
    return std::nullopt;
  }
  SamplingOptions sampling;
  sampling.half_translation_m = kSlideMaxM;
  sampling.seed = seed;
  PlaceMatch match{
      registration.patch_from_robot,
      SampleMatchCovariance(points, registration.patch_from_robot, from.patch, grid, sampling),
      CompareFinishedPlaces(from, to, registration.patch_from_robot),
      0.0,
      ""};
  match.reason = JudgeAgreement(match.agreement, limits);
  if (match.reason.empty()) {
    const double second_min = limits.second_peak_ratio_max * found->likelihood;
    SearchWindow unweighted = window;
    unweighted.border_penalty = 0.0;
    const ExcludedPoses ellipse = EllipseAround(match, found->grid_from_robot);
    const std::optional<CorrelativeMatch> second =
        search.FindBest(search_points, prediction.from_from_to, unweighted, second_min, &ellipse);
    if (second.has_value()) {
      match.second_peak_ratio = second->likelihood / found->likelihood;
      match.reason = "a second peak reaches " + Percent(match.second_peak_ratio) + " of the best";
    }
  }
  return match;
}

}  // namespace loci
