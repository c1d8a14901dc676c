// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/observation_maker.h"

#include "clients/log/odometry_model.h"

namespace loci::cli {
namespace {

// The server refuses longer steps: they are jumps of the odometry, not motion. Without a motion the
// server assumes that the robot stayed and looks around there.
constexpr double kStepMaxM = 1000.0;

void Set(const Pose2& from, v1::Pose2& to) {
  to.set_x(from.x);
  to.set_y(from.y);
  to.set_theta(from.theta);
}

}  // namespace

v1::Observation ObservationMaker::Make(const LogScan& scan) {
  v1::Observation observation;
  observation.set_stamp_ns(scan.stamp_ns);
  v1::LaserScan& laser = *observation.mutable_scan();
  Set(scan.robot_from_laser, *laser.mutable_robot_from_laser());
  laser.set_angle_min_rad(scan.angle_min_rad);
  laser.set_angle_step_rad(scan.angle_step_rad);
  laser.mutable_ranges_mm()->Add(scan.ranges_mm.begin(), scan.ranges_mm.end());
  const bool newer = !odom_from_previous_.has_value() || scan.stamp_ns > previous_stamp_ns_;
  if (odom_from_previous_.has_value()) {
    const Pose2 step = Inverse(*odom_from_previous_) * scan.odom_from_robot;
    if (step.translation().norm() < kStepMaxM) {
      v1::Odometry& odometry = *observation.mutable_odometry();
      Set(step, *odometry.mutable_previous_from_robot());
      for (const double entry : OdometryCovarianceUpper(step)) {
        odometry.add_covariance(entry);
      }
    }
  }
  if (newer) {
    odom_from_previous_ = scan.odom_from_robot;
    previous_stamp_ns_ = scan.stamp_ns;
  }
  return observation;
}

}  // namespace loci::cli
