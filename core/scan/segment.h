// SPDX-License-Identifier: Apache-2.0
// Segmentation of a scan by a distance criterion (SCRIM, section II.E).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/scan/scan_points.h"

namespace loci {

// Points [begin, end) of a scan that hang together.
struct Segment {
  std::size_t begin = 0;
  std::size_t end = 0;
};

// Neighbours belong to one segment if no more than this apart, in metres: less than the gap between
// a walking person and the wall behind, more than the distance of neighbouring beams at 15 m and 1
// degree (0.26 m).
inline constexpr double kSegmentGapM = 0.3;

// Splits points, in order of their beams, where neighbours are more than `gap_m` apart.
std::vector<Segment> SegmentByDistance(std::span<const ScanPoint> points, double gap_m);

}  // namespace loci
