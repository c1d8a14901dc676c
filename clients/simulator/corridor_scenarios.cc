// SPDX-License-Identifier: Apache-2.0
// Buildings that are hard for a mapper: a long loop, copies of one room, a bare corridor.
#include <array>

#include "clients/simulator/scenario_parts.h"
#include "core/base/random.h"

namespace loci::simulator {
namespace {

using Eigen::Vector2d;

constexpr double kCorridorM = 2.4;

Scenario OneRobot(const char* name, std::vector<Vector2d> waypoints) {
  Scenario scenario;
  scenario.name = name;
  SessionPlan session;
  session.robot = "r1";
  session.session = "r1-1";
  session.waypoints = std::move(waypoints);
  scenario.sessions.push_back(std::move(session));
  return scenario;
}

// Pilasters and cabinets along a wall, at distances that do not repeat.
void AddPilasters(FloorPlan& plan,
                  const Vector2d& from,
                  const Vector2d& to,
                  const Vector2d& inward,
                  RandomSequence& random) {
  const double length_m = (to - from).norm();
  const Vector2d along = (to - from) / length_m;
  for (double at_m = random.NextUniform(2.0, 5.0); at_m < length_m - 2.0;
       at_m += random.NextUniform(2.5, 8.0)) {
    const double width_m = random.NextUniform(0.25, 1.2);
    const double depth_m = random.NextUniform(0.12, 0.4);
    const bool along_x = along.x() * along.x() > 0.5;
    plan.AddFurniture(
        {.centre = from + at_m * along + (0.07 + 0.5 * depth_m) * inward,
         .size_m = along_x ? Vector2d(width_m, depth_m) : Vector2d(depth_m, width_m)});
  }
}

// One storey's corridor with four rooms in every block of 12 m, all blocks the same.
void AddBlocks(FloorPlan& plan, double y, int count) {
  constexpr double kBlockM = 12.0;
  constexpr double kRoomM = 5.0;
  const double length_m = kBlockM * count;
  std::vector<Opening> upper;
  std::vector<Opening> lower;
  for (int block = 0; block < count; ++block) {
    for (const double door : {3.0, 9.0}) {
      const double at_m = kBlockM * block + door;
      upper.push_back({.at_m = at_m, .leaf = Opening::Leaf::kOpenDoor});
      lower.push_back({.at_m = length_m - at_m, .leaf = Opening::Leaf::kOpenDoor});
    }
    for (const double x : {0.0, 6.0}) {
      const double wall_x = kBlockM * block + x;
      plan.AddWall({wall_x, y + kCorridorM}, {wall_x, y + kCorridorM + kRoomM});
      plan.AddWall({wall_x, y - kRoomM}, {wall_x, y});
      for (const double room_y : {y + kCorridorM + 3.6, y - 3.6}) {
        plan.AddFurniture({.centre = {wall_x + 1.1, room_y}, .size_m = {0.7, 1.4}});
        plan.AddFurniture({.centre = {wall_x + 4.6, room_y + 0.3}, .size_m = {0.9, 0.4}});
      }
    }
  }
  plan.AddWall({0.0, y + kCorridorM}, {length_m, y + kCorridorM}, upper);
  plan.AddWall({length_m, y}, {0.0, y}, lower);
  plan.AddWall({0.0, y + kCorridorM + kRoomM}, {length_m, y + kCorridorM + kRoomM});
  plan.AddWall({0.0, y - kRoomM}, {length_m, y - kRoomM});
  plan.AddWall({0.0, y}, {0.0, y + kCorridorM});
  plan.AddWall({length_m, y + kCorridorM}, {length_m, y + kCorridorM + kRoomM});
  plan.AddWall({length_m, y - kRoomM}, {length_m, y});
}

}  // namespace

Scenario MakeLoop() {
  constexpr double kWidth = 72.4;
  constexpr double kHeight = 44.4;
  constexpr double kMiddle = 0.5 * kCorridorM;
  Scenario scenario = OneRobot("loop",
                               {{30.0, kMiddle},
                                {kWidth - kMiddle, kMiddle},
                                {kWidth - kMiddle, kHeight - kMiddle},
                                {kMiddle, kHeight - kMiddle},
                                {kMiddle, kMiddle},
                                {65.0, kMiddle}});
  OdometrySettings& odometry = scenario.sessions[0].odometry;
  odometry.drift_rad_m = 0.008;
  odometry.distance_scale = 1.03;
  odometry.turn_scale = 0.97;
  odometry.turn_noise_rad = 0.01;
  FloorPlan& plan = scenario.plan;
  const Vector2d inner_low(kCorridorM, kCorridorM);
  const Vector2d inner_high(kWidth - kCorridorM, kHeight - kCorridorM);
  plan.AddRoom({0.0, 0.0}, {kWidth, kHeight});
  plan.AddRoom(inner_low, inner_high);
  RandomSequence random(2);
  AddPilasters(plan, {0.0, 0.0}, {kWidth, 0.0}, {0.0, 1.0}, random);
  AddPilasters(plan, {kWidth, 0.0}, {kWidth, kHeight}, {-1.0, 0.0}, random);
  AddPilasters(plan, {kWidth, kHeight}, {0.0, kHeight}, {0.0, -1.0}, random);
  AddPilasters(plan, {0.0, kHeight}, {0.0, 0.0}, {1.0, 0.0}, random);
  AddPilasters(plan, inner_low, {inner_high.x(), inner_low.y()}, {0.0, -1.0}, random);
  AddPilasters(plan, {inner_high.x(), inner_low.y()}, inner_high, {1.0, 0.0}, random);
  AddPilasters(plan, inner_high, {inner_low.x(), inner_high.y()}, {0.0, 1.0}, random);
  AddPilasters(plan, {inner_low.x(), inner_high.y()}, inner_low, {-1.0, 0.0}, random);
  plan.AddPerson({.route = {{40.0, 1.6}, {68.0, 0.9}}, .phase_s = 5.0});
  return scenario;
}

Scenario MakeSelfSimilar() {
  constexpr int kBlocks = 5;
  constexpr double kLength = 12.0 * kBlocks;
  constexpr double kFloorM = 14.8;  // from one storey's corridor to the next
  constexpr double kMiddle = 0.5 * kCorridorM;
  // Along one corridor, over to its copy and back along it; one room of every second block.
  std::vector<Vector2d> way = {{1.2, kMiddle}};
  for (const double x : {15.0, 39.0}) {
    for (const double y : {kMiddle, 4.2, 5.0, 4.2, kMiddle}) {
      way.emplace_back(y == 5.0 ? x + 0.4 : x, y);
    }
  }
  way.emplace_back(kLength + kMiddle, kMiddle);
  way.emplace_back(kLength + kMiddle, kFloorM + kMiddle);
  for (const double x : {51.0, 27.0}) {
    for (const double y : {kMiddle, 4.2, 5.0, 4.2, kMiddle}) {
      way.emplace_back(y == 5.0 ? x + 0.4 : x, kFloorM + y);
    }
  }
  way.emplace_back(1.2, kFloorM + kMiddle);
  Scenario scenario = OneRobot("self-similar", std::move(way));
  FloorPlan& plan = scenario.plan;
  AddBlocks(plan, 0.0, kBlocks);
  AddBlocks(plan, kFloorM, kBlocks);
  // The passage between the two.
  plan.AddWall({kLength, 0.0}, {kLength + kCorridorM, 0.0});
  plan.AddWall({kLength + kCorridorM, 0.0}, {kLength + kCorridorM, kFloorM + kCorridorM});
  plan.AddWall({kLength + kCorridorM, kFloorM + kCorridorM}, {kLength, kFloorM + kCorridorM});
  plan.AddWall({kLength, kCorridorM}, {kLength, kFloorM});
  return scenario;
}

Scenario MakeLongCorridor() {
  constexpr double kLength = 120.0;
  constexpr double kMiddle = 0.5 * kCorridorM;
  Scenario scenario = OneRobot("long-corridor",
                               {{1.5, kMiddle - 0.2},
                                {kLength - 1.5, kMiddle - 0.2},
                                {kLength - 1.5, kMiddle + 0.3},
                                {1.5, kMiddle + 0.3}});
  std::vector<Opening> doors;
  for (const double at_m : {9.0, 31.0, 44.5, 71.0, 98.0, 110.5}) {
    doors.push_back({.at_m = at_m, .width_m = 1.1, .leaf = Opening::Leaf::kNone});
  }
  FloorPlan& plan = scenario.plan;
  plan.AddWall({0.0, 0.0}, {kLength, 0.0});
  plan.AddWall({kLength, 0.0}, {kLength, kCorridorM});
  plan.AddWall({0.0, kCorridorM}, {kLength, kCorridorM}, doors);
  plan.AddWall({0.0, kCorridorM}, {0.0, 0.0});
  // Behind the openings: niches, each as deep as the next.
  for (const Opening& door : doors) {
    plan.AddWall({door.at_m - 0.7, kCorridorM + 0.5}, {door.at_m + 0.7, kCorridorM + 0.5});
  }
  return scenario;
}

}  // namespace loci::simulator
