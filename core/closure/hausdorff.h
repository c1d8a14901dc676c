// SPDX-License-Identifier: Apache-2.0
// How well two places agree where both looked: tests 2 and 3 of a loop closure (design.md, 4.9).
#pragma once

#include <cstdint>

#include "core/geometry/se2.h"
#include "core/place/place.h"

namespace loci {

struct Agreement {
  // Of the patch points in the area that both observed, the part that lies within kHausdorffReachM
  // of a point of the other patch (the partial Hausdorff fraction); both directions together.
  double hausdorff_fraction = 0.0;
  double overlap_m2 = 0.0;  // area that both observed
  // Of the same points, the part that lies where the other place is sure that nothing stood; the
  // worse of the two directions.
  double free_conflict_fraction = 0.0;
};

inline constexpr double kHausdorffReachM = 0.1;

// Compares two finished places at a relative pose. Points count that were seen at least twice.
Agreement CompareFinishedPlaces(const Place& from, const Place& to, const Pose2& from_from_to);

}  // namespace loci
