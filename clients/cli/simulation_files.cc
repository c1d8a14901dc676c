// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/simulation_files.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "clients/cli/json_output.h"
#include "clients/cli/text_output.h"

namespace loci::cli {
namespace {

using Eigen::Vector2d;
using simulator::Segment;
using simulator::SimulatedScan;
using simulator::SimulatedSession;

std::string PoseText(const Pose2& pose) {
  return ' ' + FixedText(pose.x, 6) + ' ' + FixedText(pose.y, 6) + ' ' + FixedText(pose.theta, 6);
}

// Stamps of CARMEN have microseconds.
std::string CarmenStamp(std::int64_t stamp_ns) {
  std::string text = StampText(stamp_ns);
  text.resize(text.size() - 3);
  return text;
}

// Calls `visit(column, row)` for cells along a segment, at most half a cell apart.
template <typename Visit>
void VisitCells(const Segment& segment, const OccupancyMap& map, const Visit& visit) {
  const double length_m = (segment.to - segment.from).norm();
  const int steps = std::max(1, static_cast<int>(std::ceil(length_m / (0.5 * map.resolution_m))));
  for (int step = 0; step <= steps; ++step) {
    const Vector2d point =
        segment.from + (static_cast<double>(step) / steps) * (segment.to - segment.from);
    visit(static_cast<std::int32_t>(std::floor((point.x() - map.x_min_m) / map.resolution_m)),
          static_cast<std::int32_t>(std::floor((point.y() - map.y_min_m) / map.resolution_m)));
  }
}

// All cells that can be reached from one cell without crossing an occupied one become free.
void FloodFree(OccupancyMap& map, std::int32_t column, std::int32_t row) {
  std::vector<std::pair<std::int32_t, std::int32_t>> waiting = {{column, row}};
  while (!waiting.empty()) {
    const auto [x, y] = waiting.back();
    waiting.pop_back();
    if (x < 0 || y < 0 || x >= map.width || y >= map.height ||
        map.at(x, y) != OccupancyMap::Cell::kUnknown) {
      continue;
    }
    map.at(x, y) = OccupancyMap::Cell::kFree;
    for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      waiting.emplace_back(x + dx, y + dy);
    }
  }
}

bool BordersOnFree(const OccupancyMap& map, std::int32_t column, std::int32_t row) {
  for (std::int32_t y = std::max(0, row - 1); y <= std::min(map.height - 1, row + 1); ++y) {
    for (std::int32_t x = std::max(0, column - 1); x <= std::min(map.width - 1, column + 1); ++x) {
      if (map.at(x, y) == OccupancyMap::Cell::kFree) {
        return true;
      }
    }
  }
  return false;
}

std::vector<Segment> SurfacesWithColumns(const simulator::FloorPlan& plan,
                                         std::uint64_t day,
                                         std::uint64_t seed) {
  std::vector<Segment> surfaces = plan.ComputeSurfaces(day, seed);
  constexpr int kSides = 48;  // of a polygon for a circle: 0.2 mm off at a radius of 0.1 m
  for (const simulator::Disk& column : plan.columns()) {
    const auto corner = [&column](int side) {
      const double angle_rad = 2.0 * kPi * side / kSides;
      return Vector2d(column.centre + column.radius_m * Vector2d(Cos(angle_rad), Sin(angle_rad)));
    };
    for (int side = 0; side < kSides; ++side) {
      surfaces.push_back({corner(side), corner(side + 1)});
    }
  }
  return surfaces;
}

std::string SummaryOf(const simulator::Scenario& scenario,
                      std::uint64_t seed,
                      const std::vector<SimulatedSession>& sessions) {
  JsonWriter json;
  json.BeginObject().Key("scenario").Value(scenario.name).Key("seed").Value(seed);
  json.Key("floor_plan").Value("plan.yaml").Key("runs").BeginArray();
  for (const SimulatedSession& session : sessions) {
    const Pose2& start = session.map_from_start;
    json.BeginObject();
    json.Key("robot").Value(session.robot).Key("session").Value(session.session);
    json.Key("day").Value(session.day);
    json.Key("log").Value(session.session + ".clf");
    json.Key("truth").Value(session.session + ".truth.tum");
    json.Key("start").BeginArray().Value(start.x).Value(start.y).Value(start.theta).EndArray();
    json.Key("scans").Value(std::uint64_t{session.scans.size()});
    json.Key("seconds").Value(
        static_cast<double>(session.scans.back().stamp_ns - session.scans.front().stamp_ns) * 1e-9);
    json.Key("distance_m").Value(session.distance_m).EndObject();
  }
  json.EndArray().EndObject();
  return json.text() + '\n';
}

}  // namespace

std::string CarmenLogOf(const SimulatedSession& session) {
  std::string text = "# CARMEN log file\n";
  const Pose2& laser = session.laser.robot_from_laser;
  for (const auto& [name, value] :
       {std::pair{"", laser.x}, std::pair{"side_", laser.y}, std::pair{"angular_", laser.theta}}) {
    text += std::string("PARAM robot_frontlaser_") + name + "offset " + FixedText(value, 6) +
            " nohost 0\n";
  }
  const std::int64_t begin_ns = session.scans.empty() ? 0 : session.scans.front().stamp_ns;
  for (const SimulatedScan& scan : session.scans) {
    const std::string tail = ' ' + CarmenStamp(scan.stamp_ns) + " nohost " +
                             CarmenStamp(scan.stamp_ns - begin_ns) + '\n';
    text += "ODOM" + PoseText(scan.odom_from_robot) + " 0 0 0" + tail;
    text += "FLASER " + std::to_string(scan.ranges_m.size());
    for (const double range_m : scan.ranges_m) {
      text += range_m < session.laser.range_max_m ? ' ' + FixedText(range_m, 3) : " 81.91";
    }
    text += PoseText(scan.odom_from_robot * laser) + PoseText(scan.odom_from_robot) + tail;
  }
  return text;
}

std::string TruthOf(const SimulatedSession& session) {
  std::string text;
  for (const SimulatedScan& scan : session.scans) {
    text += TumLine(scan.stamp_ns, scan.map_from_robot) + '\n';
  }
  return text;
}

OccupancyMap FloorPlanOf(const simulator::FloorPlan& plan,
                         std::uint64_t day,
                         std::uint64_t seed,
                         const Vector2d& start,
                         double resolution_m) {
  const std::vector<Segment> surfaces = SurfacesWithColumns(plan, day, seed);
  Vector2d low = start;
  Vector2d high = start;
  for (const Segment& segment : surfaces) {
    low = low.cwiseMin(segment.from).cwiseMin(segment.to);
    high = high.cwiseMax(segment.from).cwiseMax(segment.to);
  }
  OccupancyMap map;
  map.resolution_m = resolution_m;
  // Corners on the lattice of the map's tiles, with a border of unknown cells.
  constexpr double kBorderCells = 4.0;
  map.x_min_m = (std::floor(low.x() / resolution_m) - kBorderCells) * resolution_m;
  map.y_min_m = (std::floor(low.y() / resolution_m) - kBorderCells) * resolution_m;
  map.width =
      static_cast<std::int32_t>(std::ceil((high.x() - map.x_min_m) / resolution_m + kBorderCells));
  map.height =
      static_cast<std::int32_t>(std::ceil((high.y() - map.y_min_m) / resolution_m + kBorderCells));
  map.cells.assign(static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height),
                   OccupancyMap::Cell::kUnknown);
  for (const Segment& segment : surfaces) {
    VisitCells(segment, map, [&map](std::int32_t column, std::int32_t row) {
      map.at(column, row) = OccupancyMap::Cell::kOccupied;
    });
  }
  FloodFree(map,
            static_cast<std::int32_t>(std::floor((start.x() - map.x_min_m) / resolution_m)),
            static_cast<std::int32_t>(std::floor((start.y() - map.y_min_m) / resolution_m)));
  OccupancyMap seen = map;
  for (std::int32_t row = 0; row < map.height; ++row) {
    for (std::int32_t column = 0; column < map.width; ++column) {
      if (map.at(column, row) == OccupancyMap::Cell::kOccupied &&
          !BordersOnFree(map, column, row)) {
        seen.at(column, row) = OccupancyMap::Cell::kUnknown;
      }
    }
  }
  return seen;
}

Status WriteSimulation(const std::string& folder,
                       const simulator::Scenario& scenario,
                       std::uint64_t seed,
                       const std::vector<SimulatedSession>& sessions) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return InvalidArgumentError(folder + ": cannot be made: " + error.message());
  }
  const std::filesystem::path base(folder);
  std::uint64_t last_day = 0;
  for (const SimulatedSession& session : sessions) {
    last_day = std::max(last_day, session.day);
    LOCI_RETURN_IF_ERROR(
        WriteFile((base / (session.session + ".clf")).string(), CarmenLogOf(session)));
    LOCI_RETURN_IF_ERROR(
        WriteFile((base / (session.session + ".truth.tum")).string(), TruthOf(session)));
  }
  constexpr double kResolutionM = 0.05;  // the default of maps
  LOCI_RETURN_IF_ERROR(WriteGridFile((base / "plan").string(),
                                     FloorPlanOf(scenario.plan,
                                                 last_day,
                                                 seed,
                                                 sessions.front().map_from_start.translation(),
                                                 kResolutionM)));
  return WriteFile((base / "scenario.json").string(), SummaryOf(scenario, seed, sessions));
}

}  // namespace loci::cli
