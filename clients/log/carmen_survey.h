// SPDX-License-Identifier: Apache-2.0
// What only a whole log tells: where the laser sits, and which range means that nothing was seen.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "clients/log/carmen_message.h"
#include "core/geometry/se2.h"

namespace loci {

// Collects the messages of a log, then answers. Memory does not grow with the log.
class CarmenSurvey {
 public:
  CarmenSurvey();

  void Add(const CarmenMessage& message);

  std::size_t scan_count() const { return scan_count_; }
  // 0 without scans.
  std::int64_t first_stamp_ns() const { return first_stamp_ns_; }
  std::int64_t last_stamp_ns() const { return last_stamp_ns_; }

  // Where the laser sits on the robot.
  //
  // A line holds the laser's pose and the robot's. If their relation stays the same over the log
  // (to 2 cm and 0.02 rad in 95 % of the scans), it is the answer, unless it is the identity: then
  // the writer did not tell the two apart and the PARAM lines count (robot_frontlaser_offset,
  // _side_offset, _angular_offset). If it varies, or is farther than any robot is long, a localiser
  // has moved the laser's pose into another frame, and the PARAM lines count too. Without those the
  // laser sits at the robot's centre.
  Pose2 ComputeRobotFromLaser(CarmenLaser::Kind kind) const;

  // Ranges from this on mean that nothing was seen, in millimetres; at most 65535.
  //
  // The largest range of a log is the scanner's "nothing" if it stands out: it comes at least 50
  // times and 10 times as often as any single value in the tenth of the range below it (readings of
  // far walls spread). The values within 0.2 % below are neighbours of the same kind (SICK's error
  // codes 81.83 to 81.91). Then the next largest is looked at, up to 4 times.
  std::uint16_t ComputeNothingSeenFromMm() const;

 private:
  // Relations between the two poses of a line, thinned evenly so that at most kRelationsMax stay.
  struct Relations {
    std::vector<Pose2> robot_from_laser;
    std::size_t stride = 1;
    std::size_t seen = 0;
  };
  static constexpr std::size_t kRelationsMax = 4096;

  void AddLaser(const CarmenLaser& laser);
  void AddParam(const CarmenParam& param);

  std::size_t scan_count_ = 0;
  std::int64_t first_stamp_ns_ = 0;
  std::int64_t last_stamp_ns_ = 0;
  std::array<Relations, 2> relations_;  // by CarmenLaser::Kind
  Pose2 param_offset_;
  std::vector<std::uint64_t> count_by_mm_;
};

// The range in millimetres, or LogScan::kNothingSeen for one that is not positive, not finite, from
// `nothing_from_mm` on, or exactly 50 or 51 m (what some writers put in for nothing).
std::uint16_t QuantiseRange(double range_m, std::uint16_t nothing_from_mm);

}  // namespace loci
