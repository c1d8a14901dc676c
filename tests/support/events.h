// SPDX-License-Identifier: Apache-2.0
// Events that are right in every field, for tests that change one.
#pragma once

#include <cstdint>
#include <numbers>
#include <string>

#include "core/engine/event.h"

namespace loci {

inline OpenSessionEvent ValidOpenSession(std::string session = "session-1") {
  return {.session = std::move(session), .robot = "robot_1", .map_from_start = {1.0, 2.0, 0.5}};
}

inline LaserScan ValidScan(std::size_t beam_count = 180) {
  LaserScan scan;
  scan.robot_from_laser = {0.1, 0.0, 0.0};
  scan.angle_min_rad = -std::numbers::pi / 2.0;
  scan.angle_step_rad = std::numbers::pi / static_cast<double>(beam_count);
  for (std::size_t i = 0; i < beam_count; ++i) {
    scan.ranges_mm.push_back(static_cast<std::uint16_t>(1000 + i));
  }
  return scan;
}

inline ObservationEvent ValidObservation(std::uint64_t number = 1, SessionId session = {0}) {
  ObservationEvent event;
  event.session = session;
  event.number = number;
  event.stamp_ns = static_cast<std::int64_t>(number) * 100'000'000;
  event.odometry = Odometry{.previous_from_robot = {0.1, 0.0, 0.01},
                            .covariance_upper = {1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-5}};
  event.scan = ValidScan();
  return event;
}

inline RefuseObservationEvent Refusal(std::uint64_t number, std::string reason = "late") {
  return {.session = SessionId{0}, .number = number, .reason = std::move(reason)};
}

}  // namespace loci
