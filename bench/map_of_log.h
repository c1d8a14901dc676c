// SPDX-License-Identifier: Apache-2.0
// The map that an engine makes of a CARMEN log, for benchmarks and tests that want one.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "clients/log/carmen_reader.h"
#include "clients/log/odometry_model.h"
#include "clients/log/stamp_sorter.h"
#include "core/engine/engine.h"

namespace loci {

struct MapOfLogOptions {
  MapSettings settings;
  // Called before and after each event, if set.
  std::function<void(Engine& engine, const Event& event)> before_event;
  std::function<void(Engine& engine, const Effects& effects)> after_event;
};

struct MappedLog {
  std::shared_ptr<const Snapshot> snapshot;
  Digest state_digest;
  std::uint64_t scan_count = 0;
  double log_seconds = 0.0;  // from the first stamp to the last
};

// Feeds one engine, event by event.
class LogFeeder {
 public:
  explicit LogFeeder(const MapOfLogOptions& options) : options_(options) {
    Apply(CreateMapEvent{options.settings});
    Apply(OpenSessionEvent{"session", "robot", {}});
  }

  void Take(LogScan scan) {
    if (previous_.has_value() && scan.stamp_ns <= previous_->stamp_ns) {
      return;
    }
    ++observation_.number;
    observation_.stamp_ns = scan.stamp_ns;
    if (previous_.has_value()) {
      const Pose2 motion = Inverse(previous_->odom_from_robot) * scan.odom_from_robot;
      observation_.odometry = Odometry{motion, OdometryCovarianceUpper(motion)};
    }
    observation_.scan =
        LaserScan{scan.robot_from_laser, scan.angle_min_rad, scan.angle_step_rad, scan.ranges_mm};
    Apply(observation_);
    previous_ = std::move(scan);
  }

  void Finish() { Apply(CloseSessionEvent{}); }

  Engine& engine() { return engine_; }
  std::uint64_t scan_count() const { return observation_.number; }

 private:
  void Apply(const Event& event) {
    if (options_.before_event) {
      options_.before_event(engine_, event);
    }
    const Effects effects = engine_.Apply(event);
    if (options_.after_event) {
      options_.after_event(engine_, effects);
    }
  }

  const MapOfLogOptions& options_;
  Engine engine_;
  std::optional<LogScan> previous_;
  ObservationEvent observation_;
};

// Without wire and disk: the scans go straight into an engine, in order of stamp.
inline StatusOr<MappedLog> MapOfLog(const std::string& path, const MapOfLogOptions& options = {}) {
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<CarmenReader> reader, CarmenReader::Open(path));
  StampSorter sorter;
  LogFeeder feeder(options);
  for (bool at_end = false; !at_end;) {
    LOCI_ASSIGN_OR_RETURN(std::optional<LogScan> next, reader->Next());
    at_end = !next.has_value();
    if (at_end) {
      sorter.Finish();
    } else {
      sorter.Push(*std::move(next));
    }
    while (std::optional<LogScan> scan = sorter.Pop()) {
      feeder.Take(*std::move(scan));
    }
  }
  feeder.Finish();
  return MappedLog{feeder.engine().TakeSnapshot(),
                   feeder.engine().StateDigest(),
                   feeder.scan_count(),
                   1e-9 * static_cast<double>(reader->last_stamp_ns() - reader->first_stamp_ns())};
}

}  // namespace loci
