// SPDX-License-Identifier: Apache-2.0
#include "server/convert/mapping_convert.h"

#include <limits>
#include <string>
#include <utility>

#include "server/convert/pose_convert.h"

namespace loci {
namespace {

StatusOr<Odometry> OdometryFrom(const v1::Odometry& message, const std::string& field) {
  Odometry odometry;
  if (!message.has_previous_from_robot()) {
    return InvalidArgumentError(field + ".previous_from_robot: absent");
  }
  odometry.previous_from_robot = PoseFrom(message.previous_from_robot());
  constexpr int kCount = static_cast<int>(std::tuple_size_v<decltype(odometry.covariance_upper)>);
  if (message.covariance_size() != kCount) {
    return InvalidArgumentError(field +
                                ".covariance: " + std::to_string(message.covariance_size()) +
                                " numbers, must be the 6 of the upper triangle");
  }
  for (int i = 0; i < kCount; ++i) {
    odometry.covariance_upper[static_cast<std::size_t>(i)] = message.covariance(i);
  }
  return odometry;
}

StatusOr<LaserScan> ScanFrom(const v1::LaserScan& message, const std::string& field) {
  LaserScan scan;
  scan.robot_from_laser = PoseFrom(message.robot_from_laser());
  scan.angle_min_rad = message.angle_min_rad();
  scan.angle_step_rad = message.angle_step_rad();
  scan.ranges_mm.reserve(static_cast<std::size_t>(message.ranges_mm_size()));
  for (int i = 0; i < message.ranges_mm_size(); ++i) {
    constexpr std::uint32_t kRangeMax = std::numeric_limits<std::uint16_t>::max();
    if (message.ranges_mm(i) > kRangeMax) {
      return InvalidArgumentError(field + ".ranges_mm[" + std::to_string(i) +
                                  "]: " + std::to_string(message.ranges_mm(i)) +
                                  ", must be at most " + std::to_string(kRangeMax));
    }
    scan.ranges_mm.push_back(static_cast<std::uint16_t>(message.ranges_mm(i)));
  }
  return scan;
}

}  // namespace

OpenRequest OpenRequestFrom(const v1::OpenSessionRequest& message) {
  return {message.robot(), PoseFrom(message.map_from_start())};
}

StatusOr<BatchRequest> BatchRequestFrom(const v1::AppendBatchRequest& message) {
  BatchRequest batch;
  batch.first_number = message.first_number();
  batch.observations.reserve(static_cast<std::size_t>(message.observations_size()));
  for (int i = 0; i < message.observations_size(); ++i) {
    const v1::Observation& observation = message.observations(i);
    const std::string field = "observations[" + std::to_string(i) + "]";
    ObservationEvent event;
    event.stamp_ns = observation.stamp_ns();
    if (observation.has_odometry()) {
      LOCI_ASSIGN_OR_RETURN(event.odometry,
                            OdometryFrom(observation.odometry(), field + ".odometry"));
    }
    if (observation.has_scan()) {
      LOCI_ASSIGN_OR_RETURN(event.scan, ScanFrom(observation.scan(), field + ".scan"));
    }
    batch.observations.push_back(std::move(event));
  }
  return batch;
}

void Fill(const HostedSession& hosted, v1::SessionState& message) {
  Fill(hosted.session, hosted.revision, message);
  message.set_last_durable_number(hosted.last_durable_number);
}

void Fill(const SessionSnapshot& session, Revision revision, v1::SessionState& message) {
  message.set_session(session.session);
  message.set_robot(session.robot);
  message.set_open(session.open);
  message.set_last_durable_number(session.last_number);
  message.set_last_applied_number(session.last_number);
  message.set_accepted_count(session.accepted_count);
  message.set_refused_count(session.refused_count);
  message.set_first_stamp_ns(session.first_stamp_ns);
  message.set_last_stamp_ns(session.last_stamp_ns);
  Fill(session.map_from_robot, *message.mutable_map_from_robot());
  Fill(session.map_from_odom, *message.mutable_map_from_odom());
  message.set_revision(revision.value);
}

void Fill(const AppendOutcome& outcome, v1::AppendBatchResponse& message) {
  message.set_last_durable_number(outcome.last_durable_number);
  for (const RefusedObservation& refused : outcome.refused) {
    v1::RefusedObservation& filled = *message.add_refused();
    filled.set_number(refused.number);
    filled.set_reason(refused.reason);
  }
}

}  // namespace loci
