// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/robot_motion.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/check.h"

namespace loci::simulator {
namespace {

using Eigen::Vector2d;

// The point that the robot aims at moves along the way, always `look_ahead_m` before it.
class Carrot {
 public:
  explicit Carrot(const std::vector<Vector2d>& waypoints) : waypoints_(waypoints) {}

  // Nothing when the robot has arrived.
  std::optional<Vector2d> Follow(const Vector2d& robot, double look_ahead_m) {
    while (leg_ + 1 < waypoints_.size()) {
      const Vector2d leg = waypoints_[leg_ + 1] - waypoints_[leg_];
      const double leg_m = leg.norm();
      const Vector2d point = waypoints_[leg_] + leg * (along_m_ / leg_m);
      if ((point - robot).norm() >= look_ahead_m) {
        return point;
      }
      along_m_ += kStepM;
      if (along_m_ >= leg_m) {
        along_m_ = 0.0;
        ++leg_;
      }
    }
    constexpr double kArrivedM = 0.05;
    const Vector2d& end = waypoints_.back();
    return (end - robot).norm() < kArrivedM ? std::nullopt : std::optional<Vector2d>(end);
  }

 private:
  static constexpr double kStepM = 0.01;

  const std::vector<Vector2d>& waypoints_;
  std::size_t leg_ = 0;
  double along_m_ = 0.0;
};

}  // namespace

std::vector<Pose2> Drive(const std::vector<Vector2d>& waypoints, const DriveSettings& settings) {
  LOCI_CHECK(waypoints.size() >= 2);
  const Vector2d ahead = waypoints[1] - waypoints[0];
  Pose2 pose = {waypoints[0].x(), waypoints[0].y(), Atan2(ahead.y(), ahead.x())};
  const auto standing = static_cast<std::size_t>(settings.standing_s / kMotionStepS);
  std::vector<Pose2> poses(standing, pose);
  Carrot carrot(waypoints);
  double speed_m_s = 0.0;
  // A way that turns round within the look-ahead would have no end: an hour is enough for any.
  constexpr std::size_t kStepsMax = 180'000;
  while (poses.size() < kStepsMax) {
    const std::optional<Vector2d> aim = carrot.Follow(pose.translation(), settings.look_ahead_m);
    if (!aim.has_value()) {
      break;
    }
    const Vector2d to_aim = *aim - pose.translation();
    const double error_rad = WrapAngle(Atan2(to_aim.y(), to_aim.x()) - pose.theta);
    // Turns on the spot when the aim lies far to the side; gains speed gently.
    const double wanted_m_s =
        std::abs(error_rad) > 0.8
            ? 0.0
            : std::min(settings.speed_m_s * Cos(error_rad), 2.0 * to_aim.norm() + 0.05);
    constexpr double kAccelerationM = 0.8;  // per second squared
    speed_m_s += std::clamp(wanted_m_s - speed_m_s,
                            -2.0 * kAccelerationM * kMotionStepS,
                            kAccelerationM * kMotionStepS);
    const double turn_rad_s =
        std::clamp(3.0 * error_rad, -settings.turn_rate_max_rad_s, settings.turn_rate_max_rad_s);
    pose = pose * Exp({speed_m_s * kMotionStepS, 0.0, turn_rad_s * kMotionStepS});
    poses.push_back(pose);
  }
  poses.insert(poses.end(), standing, pose);
  return poses;
}

std::vector<Pose2> FeelOdometry(const std::vector<Pose2>& map_from_robot,
                                const OdometrySettings& settings,
                                RandomSequence& random) {
  std::vector<Pose2> felt;
  felt.reserve(map_from_robot.size());
  Pose2 odom_from_robot;
  for (std::size_t i = 0; i < map_from_robot.size(); ++i) {
    if (i > 0) {
      const Eigen::Vector3d step = Log(Inverse(map_from_robot[i - 1]) * map_from_robot[i]);
      const double distance_m = step.head<2>().norm();
      const double turn_rad = std::abs(step.z());
      // Noise adds up like a random walk: its variance grows with the way.
      const double distance_noise =
          settings.distance_noise_m * std::sqrt(distance_m) * random.NextNormal();
      const double turn_noise =
          settings.turn_noise_rad * std::sqrt(distance_m + turn_rad) * random.NextNormal();
      odom_from_robot =
          odom_from_robot *
          Exp({step.x() * settings.distance_scale + distance_noise,
               step.y() * settings.distance_scale,
               step.z() * settings.turn_scale + settings.drift_rad_m * distance_m + turn_noise});
    }
    felt.push_back(odom_from_robot);
  }
  return felt;
}

}  // namespace loci::simulator
