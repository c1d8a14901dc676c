// SPDX-License-Identifier: Apache-2.0
// Scans of a log become observations as a robot sends them.
#pragma once

#include <cstdint>
#include <optional>

#include "clients/log/log_scan.h"
#include "core/geometry/se2.h"
#include "loci/v1/mapping.pb.h"

namespace loci::cli {

// Odometry becomes the motion since the session's previous observation, with the covariance of
// odometry_model.h. The same scans always give the same observations.
class ObservationMaker {
 public:
  v1::Observation Make(const LogScan& scan);

 private:
  // A scan that is not newer than what came before is refused by the server, with its odometry; the
  // next motion therefore begins at the last scan that was newer.
  std::optional<Pose2> odom_from_previous_;
  std::int64_t previous_stamp_ns_ = 0;
};

}  // namespace loci::cli
