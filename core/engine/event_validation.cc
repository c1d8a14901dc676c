// SPDX-License-Identifier: Apache-2.0
// What can be wrong with an event by itself, whatever the map.
#include <cmath>
#include <cstdio>

#include <Eigen/Eigenvalues>

#include "core/base/name.h"
#include "core/engine/event.h"

namespace loci {
namespace {

// A map is one site or one floor. At 30 km the mesh's snapped coordinates keep their exactness.
constexpr double kCoordinateMaxM = 30'000.0;
// Between two observations; more is no motion of a robot but a jump of its estimate.
constexpr double kOdometryStepMaxM = 1000.0;
// Lasers sit on their robot.
constexpr double kLaserOffsetMaxM = 100.0;
// Eigenvalues of odometry covariances, for standard deviations from 1e-7 to 1e3 (m or rad): inside,
// what sums of them tie can be solved (InformationOf in core/geometry/covariance.h).
constexpr double kEigenvalueMin = 1e-14;
constexpr double kEigenvalueMax = 1e6;
// Finer than any laser, and coarse enough to divide by.
constexpr double kAngleStepMinRad = 1e-5;
// Logs round their angle step; over a full turn of 4096 beams this allows 2.4e-6 rad each.
constexpr double kScanSpanMaxRad = 2.0 * kPi + 0.01;
constexpr std::size_t kReasonSizeMax = 1000;

std::string Text(double value) {
  std::array<char, 32> buffer = {};
  std::snprintf(buffer.data(), buffer.size(), "%.9g", value);
  return buffer.data();
}

// "observations[3]" and "odometry" make "observations[3].odometry".
std::string Join(std::string_view field, std::string_view part) {
  std::string joined(field);
  if (!joined.empty()) {
    joined += '.';
  }
  return joined.append(part);
}

Status CheckBetween(double value, double low, double high, const std::string& field) {
  if (value >= low && value <= high) {  // false for NaN
    return {};
  }
  return InvalidArgumentError(field + ": " + Text(value) + ", must be from " + Text(low) + " to " +
                              Text(high));
}

Status CheckPose(const Pose2& pose, double coordinate_max_m, const std::string& field) {
  LOCI_RETURN_IF_ERROR(CheckBetween(pose.x, -coordinate_max_m, coordinate_max_m, field + ".x"));
  LOCI_RETURN_IF_ERROR(CheckBetween(pose.y, -coordinate_max_m, coordinate_max_m, field + ".y"));
  return CheckBetween(pose.theta, -kPi, kPi, field + ".theta");
}

Status CheckNumber(std::uint64_t number, std::string_view field) {
  if (number >= 1) {
    return {};
  }
  return InvalidArgumentError(Join(field, "number") + ": 0, must be at least 1");
}

Status CheckOdometry(const Odometry& odometry, const std::string& field) {
  const Pose2& step = odometry.previous_from_robot;
  const std::string step_field = field + ".previous_from_robot";
  LOCI_RETURN_IF_ERROR(CheckPose(step, kOdometryStepMaxM, step_field));
  LOCI_RETURN_IF_ERROR(CheckBetween(
      step.translation().norm(), 0.0, kOdometryStepMaxM, step_field + ": distance in metres"));
  const std::string covariance_field = field + ".covariance";
  LOCI_ASSIGN_OR_RETURN(
      const Covariance3 covariance,
      Covariance3::FromMatrix(SymmetricFromUpper(odometry.covariance_upper), covariance_field));
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance.matrix(),
                                                              Eigen::EigenvaluesOnly);
  for (const double eigenvalue : {solver.eigenvalues().x(), solver.eigenvalues().z()}) {
    LOCI_RETURN_IF_ERROR(CheckBetween(
        eigenvalue, kEigenvalueMin, kEigenvalueMax, covariance_field + ": eigenvalue"));
  }
  return {};
}

Status CheckScan(const LaserScan& scan, const std::string& field) {
  const std::size_t count = scan.ranges_mm.size();
  if (count < 1 || count > LaserScan::kBeamCountMax) {
    return InvalidArgumentError(field + ".ranges_mm: " + std::to_string(count) +
                                " beams, must be from 1 to " +
                                std::to_string(LaserScan::kBeamCountMax));
  }
  LOCI_RETURN_IF_ERROR(
      CheckPose(scan.robot_from_laser, kLaserOffsetMaxM, field + ".robot_from_laser"));
  LOCI_RETURN_IF_ERROR(
      CheckBetween(scan.angle_min_rad, -2.0 * kPi, 2.0 * kPi, field + ".angle_min_rad"));
  LOCI_RETURN_IF_ERROR(CheckBetween(
      scan.angle_step_rad, kAngleStepMinRad, kScanSpanMaxRad, field + ".angle_step_rad"));
  const double span_rad = static_cast<double>(count - 1) * scan.angle_step_rad;
  if (span_rad > kScanSpanMaxRad) {
    return InvalidArgumentError(field + ".angle_step_rad: " + Text(scan.angle_step_rad) + " over " +
                                std::to_string(count) + " beams spans " + Text(span_rad) +
                                " rad, must be at most " + Text(kScanSpanMaxRad));
  }
  return {};
}

Status Check(const CreateMapEvent& event, std::string_view field) {
  const Status status = Validate(event.settings);
  return status.ok() ? status : Status(status.code(), Join(field, status.message()));
}

Status Check(const OpenSessionEvent& event, std::string_view field) {
  LOCI_RETURN_IF_ERROR(ValidateName(event.session, Join(field, "session")));
  LOCI_RETURN_IF_ERROR(ValidateName(event.robot, Join(field, "robot")));
  return CheckPose(event.map_from_start, kCoordinateMaxM, Join(field, "map_from_start"));
}

Status Check(const ObservationEvent& event, std::string_view field) {
  LOCI_RETURN_IF_ERROR(CheckNumber(event.number, field));
  if (event.stamp_ns < 0) {
    return InvalidArgumentError(Join(field, "stamp_ns") + ": " + std::to_string(event.stamp_ns) +
                                ", must be at least 0");
  }
  if (event.odometry.has_value()) {
    LOCI_RETURN_IF_ERROR(CheckOdometry(*event.odometry, Join(field, "odometry")));
  }
  return event.scan.has_value() ? CheckScan(*event.scan, Join(field, "scan")) : Status();
}

Status Check(const RefuseObservationEvent& event, std::string_view field) {
  LOCI_RETURN_IF_ERROR(CheckNumber(event.number, field));
  if (event.reason.size() > kReasonSizeMax) {
    return InvalidArgumentError(Join(field, "reason") + ": " + std::to_string(event.reason.size()) +
                                " bytes, must be at most " + std::to_string(kReasonSizeMax));
  }
  return {};
}

Status Check(const CloseSessionEvent& /*event*/, std::string_view /*field*/) {
  return {};
}

}  // namespace

Status ValidateEvent(const Event& event, std::string_view field) {
  return std::visit([field](const auto& alternative) { return Check(alternative, field); }, event);
}

Status ValidateObservation(const ObservationEvent& event, std::string_view field) {
  return Check(event, field);
}

}  // namespace loci
