// SPDX-License-Identifier: Apache-2.0
// Events: all that a map is ever told, and the only cause of change.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include <Eigen/Core>

#include "core/base/archive.h"
#include "core/base/ids.h"
#include "core/base/status.h"
#include "core/engine/settings.h"
#include "core/geometry/covariance.h"
#include "core/geometry/se2.h"
#include "core/scan/scan.h"

namespace loci {

// The first event of every map.
struct CreateMapEvent {
  MapSettings settings;
};

// A robot begins a run at a known pose.
struct OpenSessionEvent {
  std::string session;  // [a-z0-9_-]{1,64}, new in this map
  std::string robot;    // [a-z0-9_-]{1,64}
  Pose2 map_from_start;
};

// How the robot moved since its previous observation, by its own account.
struct Odometry {
  Pose2 previous_from_robot;
  // Of previous_from_robot; order (x, y, theta), right perturbation. Symmetric positive definite;
  // upper triangle, row by row.
  std::array<double, 6> covariance_upper = {};
};

// One observation of a session. `number` counts the session's observations from 1.
struct ObservationEvent {
  SessionId session;
  std::uint64_t number = 0;
  std::int64_t stamp_ns = 0;
  std::optional<Odometry> odometry;  // absent: not known to have moved
  std::optional<LaserScan> scan;
};

// An observation that was refused: its number is consumed and nothing else happens.
struct RefuseObservationEvent {
  SessionId session;
  std::uint64_t number = 0;
  std::string reason;
};

struct CloseSessionEvent {
  SessionId session;
};

// Alternatives keep their index for ever: it is what the log stores.
using Event = std::variant<CreateMapEvent,
                           OpenSessionEvent,
                           ObservationEvent,
                           RefuseObservationEvent,
                           CloseSessionEvent>;

template <typename Archive>
void Fields(Archive& archive, CreateMapEvent& event) {
  archive(event.settings);
}
template <typename Archive>
void Fields(Archive& archive, OpenSessionEvent& event) {
  archive(event.session, event.robot, event.map_from_start);
}
template <typename Archive>
void Fields(Archive& archive, Odometry& odometry) {
  archive(odometry.previous_from_robot, odometry.covariance_upper);
}
template <typename Archive>
void Fields(Archive& archive, ObservationEvent& event) {
  archive(event.session, event.number, event.stamp_ns, event.odometry, event.scan);
}
template <typename Archive>
void Fields(Archive& archive, RefuseObservationEvent& event) {
  archive(event.session, event.number, event.reason);
}
template <typename Archive>
void Fields(Archive& archive, CloseSessionEvent& event) {
  archive(event.session);
}

// The bytes of an event as the log stores them: a version, the alternative's index, its fields.
std::string EncodeEvent(const Event& event);
// kDataLoss if the bytes are not those of an event.
StatusOr<Event> DecodeEvent(std::string_view bytes);

// Checks everything about an event that can be wrong by itself: names, finite numbers, bounds,
// positive definite covariances, geometry of the scan. Angles of poses must be in [-pi, pi]: who
// takes angles from outside wraps them first. kInvalidArgument names the field, starting with
// `field` (for example "observations[3]"; may be empty). What depends on the map is
// AdmissionControl's.
Status ValidateEvent(const Event& event, std::string_view field);
// The same, without the copy that making an Event of it takes.
Status ValidateObservation(const ObservationEvent& event, std::string_view field);

}  // namespace loci
