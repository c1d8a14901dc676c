// SPDX-License-Identifier: Apache-2.0
// Matching one finished place against another: tests 1 to 4 of a loop closure (design.md, 4.9).
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/closure/hausdorff.h"
#include "core/geometry/covariance.h"
#include "core/geometry/se2.h"
#include "core/place/place.h"

namespace loci {

// What is known before looking.
struct PlacePrediction {
  Pose2 from_from_to;
  Eigen::Matrix3d covariance;  // (x, y, theta), right perturbation
};

struct PlaceMatch {
  Pose2 from_from_to;
  Covariance3 covariance;
  Agreement agreement;
  double second_peak_ratio = 0.0;  // score of the best pose outside of the ellipse over the best's
  std::string reason;              // why tests 2 to 4 refuse it; empty if they do not
};

struct ClosureLimits {
  double window_max_m = 15.0;
  double hausdorff_fraction_min = 0.6;
  double overlap_min_m2 = 10.0;
  double free_conflict_fraction_max = 0.05;
  double second_peak_ratio_max = 0.9;
};

// Searches `to` in `from` within 3 sigma of the prediction (test 1) and judges the result (tests 2
// to 4). Nothing if no pose in the window scores at all like a match. The seed is for the sampling
// of the covariance.
std::optional<PlaceMatch> MatchPlaces(const Place& from,
                                      const Place& to,
                                      const PlacePrediction& prediction,
                                      const ClosureLimits& limits,
                                      std::uint64_t seed);

}  // namespace loci
