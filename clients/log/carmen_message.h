// SPDX-License-Identifier: Apache-2.0
// One line of a log in CARMEN's format.
//
//   FLASER n r_1 .. r_n x y theta odom_x odom_y odom_theta ipc_stamp host logger_stamp
//   ROBOTLASER1 type start_angle fov resolution range_max accuracy remission_mode
//     n r_1 .. r_n m remission_1 .. remission_m  laser_x laser_y laser_theta
//     robot_x robot_y robot_theta tv rv [safety distances, turn axis] ipc_stamp host logger_stamp
//   ODOM x y theta tv rv acceleration ipc_stamp host logger_stamp
//   PARAM name value ..
//
// Metres, radians, seconds. Lines with any other word are other messages and are passed over.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/base/status.h"
#include "core/geometry/se2.h"

namespace loci {

// As many as the server takes.
inline constexpr std::size_t kBeamCountMax = 4096;

struct CarmenLaser {
  enum class Kind { kFlaser, kRobotLaser };
  Kind kind = Kind::kFlaser;
  std::int64_t stamp_ns = 0;
  double angle_min_rad = 0.0;
  double angle_step_rad = 0.0;
  double range_max_m = 0.0;  // 0: not told
  std::vector<double> ranges_m;
  // Both in one frame: the odometry's, unless a localiser has corrected the laser's pose.
  Pose2 world_from_laser;
  Pose2 odom_from_robot;
};

struct CarmenParam {
  std::string name;
  std::string value;
};

// Odometry on its own clock. Every scan carries the odometry of its own moment, so this is checked
// and then not needed.
struct CarmenOdometry {
  std::int64_t stamp_ns = 0;
  Pose2 odom_from_robot;
};

// Comments, blank lines and other messages.
struct CarmenOther {};

using CarmenMessage = std::variant<CarmenOther, CarmenParam, CarmenOdometry, CarmenLaser>;

// Errors, kInvalidArgument: names field, value and what is allowed.
StatusOr<CarmenMessage> ParseCarmenLine(std::string_view line);

// Direction of the first beam and step of a FLASER line, which tells only the number of beams.
struct BeamGeometry {
  double angle_min_rad = 0.0;
  double angle_step_rad = 0.0;
};
// Beam i looks along -90 degrees + i * step. The step is 180 degrees / n for an even and / (n - 1)
// for an odd number n of beams: scanners of half a turn come with and without the last beam, so 180
// and 181 beams both have 1 degree, 360 and 361 have 0.5. One beam looks straight ahead.
// Known scanners of another field of view: 541 and 1081 beams over 270 degrees (SICK LMS1xx, Hokuyo
// UTM-30LX), 682 and 683 of 360 / 1024 degrees (URG-04LX), 726 and 769 of the same step
// (UBG-04LX, URG with its full field); these are symmetric about straight ahead.
BeamGeometry FlaserGeometry(std::size_t beam_count);

}  // namespace loci
