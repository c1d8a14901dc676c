// SPDX-License-Identifier: Apache-2.0
// The map that an engine makes of a CARMEN log, for benchmarks that read maps.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "clients/log/carmen_reader.h"
#include "clients/log/odometry_model.h"
#include "clients/log/stamp_sorter.h"
#include "core/engine/engine.h"

namespace loci {

// Without wire and disk: the scans go straight into an engine, whose last snapshot is returned.
inline StatusOr<std::shared_ptr<const Snapshot>> MapOfLog(const std::string& path) {
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<CarmenReader> reader, CarmenReader::Open(path));
  StampSorter sorter;
  Engine engine;
  engine.Apply(CreateMapEvent{});
  engine.Apply(OpenSessionEvent{"session", "robot", {}});
  std::optional<LogScan> previous;
  ObservationEvent event;
  for (bool at_end = false; !at_end;) {
    LOCI_ASSIGN_OR_RETURN(std::optional<LogScan> next, reader->Next());
    at_end = !next.has_value();
    if (at_end) {
      sorter.Finish();
    } else {
      sorter.Push(*std::move(next));
    }
    while (std::optional<LogScan> scan = sorter.Pop()) {
      if (previous.has_value() && scan->stamp_ns <= previous->stamp_ns) {
        continue;
      }
      ++event.number;
      event.stamp_ns = scan->stamp_ns;
      if (previous.has_value()) {
        const Pose2 motion = Inverse(previous->odom_from_robot) * scan->odom_from_robot;
        event.odometry = Odometry{motion, OdometryCovarianceUpper(motion)};
      }
      event.scan = LaserScan{
          scan->robot_from_laser, scan->angle_min_rad, scan->angle_step_rad, scan->ranges_mm};
      engine.Apply(event);
      previous = std::move(scan);
    }
  }
  engine.Apply(CloseSessionEvent{});
  return engine.TakeSnapshot();
}

}  // namespace loci
