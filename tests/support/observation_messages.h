// SPDX-License-Identifier: Apache-2.0
// Observations as robots send them.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/engine/event.h"
#include "loci/v1/mapping.pb.h"

namespace loci {

inline void SetPose(const Pose2& pose, v1::Pose2& message) {
  message.set_x(pose.x);
  message.set_y(pose.y);
  message.set_theta(pose.theta);
}

inline v1::Observation MessageOf(const ObservationEvent& event) {
  v1::Observation message;
  message.set_stamp_ns(event.stamp_ns);
  if (event.odometry.has_value()) {
    SetPose(event.odometry->previous_from_robot,
            *message.mutable_odometry()->mutable_previous_from_robot());
    for (const double number : event.odometry->covariance_upper) {
      message.mutable_odometry()->add_covariance(number);
    }
  }
  if (event.scan.has_value()) {
    v1::LaserScan& scan = *message.mutable_scan();
    SetPose(event.scan->robot_from_laser, *scan.mutable_robot_from_laser());
    scan.set_angle_min_rad(event.scan->angle_min_rad);
    scan.set_angle_step_rad(event.scan->angle_step_rad);
    for (const std::uint16_t range_mm : event.scan->ranges_mm) {
      scan.add_ranges_mm(range_mm);
    }
  }
  return message;
}

// Observations [begin, end) of a drive that is numbered from 1.
inline v1::AppendBatchRequest BatchOf(const std::string& map,
                                      const std::string& session,
                                      const std::vector<ObservationEvent>& drive,
                                      std::size_t begin,
                                      std::size_t end) {
  v1::AppendBatchRequest request;
  request.set_map(map);
  request.set_session(session);
  request.set_first_number(begin + 1);
  for (std::size_t i = begin; i < end; ++i) {
    *request.add_observations() = MessageOf(drive[i]);
  }
  return request;
}

}  // namespace loci
