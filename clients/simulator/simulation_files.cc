// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/simulation_files.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <system_error>

namespace loci::simulator {
namespace {

constexpr double kCellM = 0.05;
constexpr int kMarginCells = 20;

template <typename... Values>
std::string Format(const char* format, Values... values) {
  char text[256];
  std::snprintf(text, sizeof(text), format, values...);
  return text;
}

Status WriteFile(const std::filesystem::path& path, const std::string& content) {
  std::ofstream file(path, std::ios::binary);
  file << content;
  file.close();
  return file ? Status() : UnavailableError(path.string() + ": cannot be written");
}

std::string LogOf(const SimulatedRun& run, const Sensors& sensors) {
  std::string text =
      "# CARMEN Logfile, simulated\n"
      "# FLASER num_readings [range_readings] x y theta odom_x odom_y odom_theta ipc_stamp host "
      "logger_stamp\n";
  text += Format("PARAM robot_frontlaser_offset %.6f sim 0\n", sensors.robot_from_laser.x);
  for (const SimulatedScan& scan : run.scans) {
    text += Format("FLASER %zu", scan.ranges_m.size());
    for (const double range_m : scan.ranges_m) {
      text += Format(" %.3f", range_m);
    }
    const Pose2 laser = scan.odom_from_robot * sensors.robot_from_laser;
    const Pose2& robot = scan.odom_from_robot;
    text += Format(" %.6f %.6f %.8f", laser.x, laser.y, laser.theta);
    text += Format(" %.6f %.6f %.8f", robot.x, robot.y, robot.theta);
    text += Format(" %.6f sim %.6f\n", scan.stamp_s, scan.stamp_s);
  }
  return text;
}

std::string TruthOf(const SimulatedRun& run) {
  std::string text = "# stamp x y z qx qy qz qw\n";
  for (const SimulatedScan& scan : run.scans) {
    const Pose2& pose = scan.building_from_robot;
    text += Format("%.6f %.6f %.6f 0 0 0 ", scan.stamp_s, pose.x, pose.y);
    text += Format("%.9f %.9f\n", std::sin(0.5 * pose.theta), std::cos(0.5 * pose.theta));
  }
  return text;
}

// The wall points of the last day as a map_server picture.
Status WriteFloorPlan(const std::vector<SimulatedRun>& runs,
                      const std::filesystem::path& directory) {
  const std::size_t last_day = runs.back().day;
  std::vector<Eigen::Vector2i> cells;
  for (const SimulatedRun& run : runs) {
    if (run.day != last_day) {
      continue;
    }
    for (const Eigen::Vector2d& point : run.wall_points) {
      cells.emplace_back(static_cast<int>(std::floor(point.x() / kCellM)),
                         static_cast<int>(std::floor(point.y() / kCellM)));
    }
  }
  if (cells.empty()) {
    return FailedPreconditionError("scenario: no beam met a wall");
  }
  Eigen::Vector2i low = cells[0];
  Eigen::Vector2i high = cells[0];
  for (const Eigen::Vector2i& cell : cells) {
    low = low.cwiseMin(cell);
    high = high.cwiseMax(cell);
  }
  low.array() -= kMarginCells;
  const Eigen::Vector2i size = high - low + Eigen::Vector2i::Constant(kMarginCells + 1);
  constexpr char kUnknown = static_cast<char>(205);
  std::string pixels(static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()),
                     kUnknown);
  for (const Eigen::Vector2i& cell : cells) {
    const int row = size.y() - 1 - (cell.y() - low.y());  // the first row is the top
    const int column = cell.x() - low.x();
    pixels[static_cast<std::size_t>(row) * static_cast<std::size_t>(size.x()) +
           static_cast<std::size_t>(column)] = 0;
  }
  LOCI_RETURN_IF_ERROR(WriteFile(directory / "floor_plan.pgm",
                                 Format("P5\n%d %d\n255\n", size.x(), size.y()) + pixels));
  return WriteFile(directory / "floor_plan.yaml",
                   Format("image: floor_plan.pgm\nresolution: %.3f\norigin: [%.3f, %.3f, 0.0]\n",
                          kCellM,
                          low.x() * kCellM,
                          low.y() * kCellM) +
                       "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n");
}

std::string DescriptionOf(const Scenario& scenario,
                          std::uint64_t seed,
                          const std::vector<SimulatedRun>& runs,
                          const std::vector<RunFiles>& files) {
  // Names are of our own making: nothing in them needs escaping.
  std::string text = "{\n  \"name\": \"" + scenario.name +
                     "\",\n  \"seed\": " + std::to_string(seed) +
                     ",\n  \"floor_plan\": \"floor_plan.yaml\",\n";
  text += "  \"runs\": [";
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Pose2& start = runs[i].scans.front().building_from_robot;
    text += std::string(i == 0 ? "\n" : ",\n") + "    {\"robot\": \"" + runs[i].robot +
            "\", \"session\": \"" + runs[i].session +
            "\", \"day\": " + std::to_string(runs[i].day) + ", \"log\": \"" + files[i].log +
            "\", \"truth\": \"" + files[i].truth + "\", " +
            Format("\"start\": [%.9f, %.9f, %.9f]}", start.x, start.y, start.theta);
  }
  return text + "\n  ]\n}\n";
}

}  // namespace

StatusOr<std::vector<RunFiles>> WriteSimulation(const Scenario& scenario,
                                                std::uint64_t seed,
                                                const std::vector<SimulatedRun>& runs,
                                                const std::string& directory) {
  const std::filesystem::path folder(directory);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return UnavailableError(directory + ": " + error.message());
  }
  std::vector<RunFiles> files;
  for (const SimulatedRun& run : runs) {
    files.push_back({run.session + ".clf", run.session + ".truth.tum"});
    LOCI_RETURN_IF_ERROR(WriteFile(folder / files.back().log, LogOf(run, scenario.sensors)));
    LOCI_RETURN_IF_ERROR(WriteFile(folder / files.back().truth, TruthOf(run)));
  }
  LOCI_RETURN_IF_ERROR(WriteFloorPlan(runs, folder));
  LOCI_RETURN_IF_ERROR(
      WriteFile(folder / "scenario.json", DescriptionOf(scenario, seed, runs, files)));
  return files;
}

}  // namespace loci::simulator
