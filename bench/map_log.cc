// SPDX-License-Identifier: Apache-2.0
// The whole pipeline without the wire and the disk: a CARMEN log goes straight into an engine.
//
//   map_log LOG --out TRAJECTORY.tum [--place-length M] [--seed N] [--closures]
//
// Prints one line: scans, seconds, real-time factor, places, closures, and the cells written by
// integration, consolidation and remeshing. For accuracy tables.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <string>

#include "clients/log/carmen_reader.h"
#include "clients/log/odometry_model.h"
#include "clients/log/stamp_sorter.h"
#include "core/engine/engine.h"

namespace loci {
namespace {

struct Arguments {
  std::string log;
  std::string out;
  MapSettings settings;
  bool closures = false;
};

Event ObservationOf(const LogScan& scan, std::uint64_t number, const LogScan* previous) {
  ObservationEvent event;
  event.number = number;
  event.stamp_ns = scan.stamp_ns;
  if (previous != nullptr) {
    Odometry odometry;
    odometry.previous_from_robot = Inverse(previous->odom_from_robot) * scan.odom_from_robot;
    odometry.covariance_upper = OdometryCovarianceUpper(odometry.previous_from_robot);
    event.odometry = odometry;
  }
  LaserScan laser;
  laser.robot_from_laser = scan.robot_from_laser;
  laser.angle_min_rad = scan.angle_min_rad;
  laser.angle_step_rad = scan.angle_step_rad;
  laser.ranges_mm = scan.ranges_mm;
  event.scan = std::move(laser);
  return event;
}

void WriteTrajectory(const Snapshot& snapshot, const std::string& path) {
  std::ofstream out(path);
  out << std::fixed << std::setprecision(9);
  for (const auto& piece : snapshot.sessions[0].trajectory) {
    for (const TrajectoryPose& pose : *piece) {
      const Pose2 map_from_robot =
          snapshot.places[pose.place.value].map_from_place * pose.place_from_robot;
      out << pose.stamp_ns / 1000000000 << '.' << std::setw(9) << std::setfill('0')
          << pose.stamp_ns % 1000000000 << ' ' << map_from_robot.x << ' ' << map_from_robot.y
          << " 0 0 0 " << std::sin(map_from_robot.theta / 2) << ' '
          << std::cos(map_from_robot.theta / 2) << '\n';
    }
  }
}

void PrintClosures(const Snapshot& snapshot) {
  for (const ClosureSnapshot& closure : *snapshot.closures) {
    std::printf(
        "closure %u %u %d correction %.3f m, chi2 %.2f, alike %.2f, overlap %.0f m2, "
        "free %.3f, sigma %.3f %.3f %.4f: %s\n",
        closure.from.value,
        closure.to.value,
        static_cast<int>(closure.state),
        closure.correction_m,
        closure.chi2,
        closure.hausdorff_fraction,
        closure.overlap_m2,
        closure.free_conflict_fraction,
        std::sqrt(closure.covariance(0, 0)),
        std::sqrt(closure.covariance(1, 1)),
        std::sqrt(closure.covariance(2, 2)),
        closure.reason.c_str());
  }
}

Status Run(const Arguments& arguments) {
  LOCI_ASSIGN_OR_RETURN(const std::unique_ptr<CarmenReader> reader,
                        CarmenReader::Open(arguments.log));
  StampSorter sorter;
  Engine engine;
  engine.Apply(CreateMapEvent{arguments.settings});
  engine.Apply(OpenSessionEvent{"s", "r", {}});
  const auto begin = std::chrono::steady_clock::now();
  std::optional<LogScan> previous;
  std::uint64_t number = 0;
  bool at_end = false;
  while (true) {
    while (std::optional<LogScan> scan = sorter.Pop()) {
      if (previous.has_value() && scan->stamp_ns <= previous->stamp_ns) {
        continue;
      }
      engine.Apply(ObservationOf(*scan, ++number, previous.has_value() ? &*previous : nullptr));
      previous = std::move(scan);
    }
    if (at_end) {
      break;
    }
    LOCI_ASSIGN_OR_RETURN(std::optional<LogScan> next, reader->Next());
    if (next.has_value()) {
      sorter.Push(*std::move(next));
    } else {
      sorter.Finish();
      at_end = true;
    }
  }
  engine.Apply(CloseSessionEvent{});
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const std::shared_ptr<const Snapshot> snapshot = engine.TakeSnapshot();
  if (!arguments.out.empty()) {
    WriteTrajectory(*snapshot, arguments.out);
  }
  if (arguments.closures) {
    PrintClosures(*snapshot);
  }
  const double log_seconds =
      1e-9 * static_cast<double>(reader->last_stamp_ns() - reader->first_stamp_ns());
  std::printf(
      "scans %llu seconds %.2f factor %.1f places %zu closures %u tried %zu overlays %zu "
      "chi2 %.1f ltrs %zu cells %llu %llu %llu digest %s\n",
      static_cast<unsigned long long>(number),
      seconds,
      log_seconds / seconds,
      snapshot->places.size(),
      snapshot->closures_accepted,
      snapshot->closures->size(),
      snapshot->overlays.size(),
      snapshot->chi2,
      snapshot->mesh->ltrs.size(),
      static_cast<unsigned long long>(snapshot->cells_written.integrate),
      static_cast<unsigned long long>(snapshot->cells_written.consolidate),
      static_cast<unsigned long long>(snapshot->cells_written.remesh),
      engine.StateDigest().ToHex().c_str());
  return {};
}

}  // namespace
}  // namespace loci

int main(int argc, char** argv) {
  loci::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const char* value = i + 1 < argc ? argv[i + 1] : "";
    if (word == "--out") {
      arguments.out = value;
      ++i;
    } else if (word == "--place-length") {
      arguments.settings.place_length_m = std::atof(value);
      ++i;
    } else if (word == "--seed") {
      arguments.settings.seed = std::strtoull(value, nullptr, 10);
      ++i;
    } else if (word == "--closures") {
      arguments.closures = true;
    } else {
      arguments.log = word;
    }
  }
  if (arguments.log.empty()) {
    std::fprintf(stderr, "usage: map_log LOG --out TRAJECTORY.tum [--place-length M] [--seed N]\n");
    return 2;
  }
  if (const loci::Status status = loci::Run(arguments); !status.ok()) {
    std::fprintf(stderr, "%s\n", status.ToString().c_str());
    return 1;
  }
  return 0;
}
