// SPDX-License-Identifier: Apache-2.0
#include "core/scan/segment.h"

namespace loci {

std::vector<Segment> SegmentByDistance(std::span<const ScanPoint> points, double gap_m) {
  std::vector<Segment> segments;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool joined =
        i > 0 &&
        (points[i].point_in_robot - points[i - 1].point_in_robot).squaredNorm() <= gap_m * gap_m;
    if (joined) {
      segments.back().end = i + 1;
    } else {
      segments.push_back({i, i + 1});
    }
  }
  return segments;
}

}  // namespace loci
