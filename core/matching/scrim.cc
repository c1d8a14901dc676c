// SPDX-License-Identifier: Apache-2.0
#include "core/matching/scrim.h"

#include <algorithm>
#include <vector>

#include "core/base/random.h"
#include "core/matching/correlative_search.h"
#include "core/matching/line_registration.h"

namespace loci {
namespace {

// The registrations of a sample look at about this many points: enough for where a sample settles,
// which is all that is asked of it.
constexpr std::size_t kPointsPerSample = 90;
constexpr int kIterations = 8;
constexpr double kSampleStepMin = 1e-3;  // a tenth of the floor
// A registration that leaps further than this has lost its lines: it says nothing about the pose.
constexpr double kLeapM = 1.0;
constexpr double kFloorTranslationM = 0.01;
constexpr double kFloorThetaRad = 0.003;

struct Sample {
  Eigen::Vector3d difference;  // Log(pose^-1 * result)
  double correlation = 0.0;
};

std::vector<Eigen::Vector2d> Thinned(std::span<const Eigen::Vector2d> points) {
  const std::size_t step = std::max<std::size_t>(1, points.size() / kPointsPerSample);
  std::vector<Eigen::Vector2d> thinned;
  for (std::size_t i = 0; i < points.size(); i += step) {
    thinned.push_back(points[i]);
  }
  return thinned;
}

}  // namespace

Covariance3 SampleMatchCovariance(std::span<const Eigen::Vector2d> points_in_robot,
                                  const Pose2& patch_from_robot,
                                  const Patch& patch,
                                  const LikelihoodGrid& grid,
                                  const SamplingOptions& options) {
  const std::vector<Eigen::Vector2d> points = Thinned(points_in_robot);
  RandomSequence random(options.seed);
  std::vector<Sample> samples;
  RegistrationOptions registration;
  registration.iterations_max = kIterations;
  registration.step_min = kSampleStepMin;
  for (int i = 0; i < options.sample_count; ++i) {
    const double x = random.NextUniform(-options.half_translation_m, options.half_translation_m);
    const double y = random.NextUniform(-options.half_translation_m, options.half_translation_m);
    const double theta = random.NextUniform(-options.half_theta_rad, options.half_theta_rad);
    const Pose2 start = patch_from_robot * Pose2{x, y, theta};
    const Registration result = RegisterToLines(points, start, patch, registration);
    const Pose2 moved = Inverse(start) * result.patch_from_robot;
    if (moved.translation().norm() > kLeapM) {
      continue;
    }
    samples.push_back({Log(Inverse(patch_from_robot) * result.patch_from_robot),
                       CorrelationAt(points, result.patch_from_robot, grid)});
  }
  if (samples.empty()) {
    return Covariance3::FromSigmas(
        options.half_translation_m, options.half_translation_m, options.half_theta_rad);
  }
  std::vector<double> correlations;
  for (const Sample& sample : samples) {
    correlations.push_back(sample.correlation);
  }
  std::nth_element(correlations.begin(),
                   correlations.begin() + static_cast<std::ptrdiff_t>(correlations.size() / 2),
                   correlations.end());
  const double median = correlations[correlations.size() / 2];

  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  double weight_sum = 0.0;
  for (const Sample& sample : samples) {
    if (sample.correlation >= median) {
      sum += sample.correlation * sample.difference * sample.difference.transpose();
      weight_sum += sample.correlation;
    }
  }
  Eigen::Matrix3d covariance =
      Covariance3::FromSigmas(kFloorTranslationM, kFloorTranslationM, kFloorThetaRad).matrix();
  if (weight_sum > 0.0) {
    covariance += sum / weight_sum;
  }
  StatusOr<Covariance3> checked = Covariance3::FromMatrix(covariance, "match");
  LOCI_CHECK(checked.ok());  // a floor plus squares
  return *checked;
}

}  // namespace loci
