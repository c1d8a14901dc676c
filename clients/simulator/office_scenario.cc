// SPDX-License-Identifier: Apache-2.0
// An office of 38 x 26 m: a ring of corridors, rooms around it, a core inside it.
#include <cmath>
#include <utility>

#include "clients/simulator/scenario_parts.h"

namespace loci::simulator {
namespace {

using Eigen::Vector2d;
using Way = std::vector<Vector2d>;

// The corridors' centre lines form a rectangle; each robot keeps to its own side.
constexpr double kRingLow = 5.6;  // outer faces of the corridors, x and y
constexpr double kRingRight = 32.4;
constexpr double kRingTop = 20.4;
constexpr double kCorridorM = 2.3;

// Openings of a wall that begins at `begin` of an axis and runs along it, at positions on the axis.
std::vector<Opening> DoorsAt(double begin,
                             const std::vector<double>& positions,
                             Opening::Leaf leaf = Opening::Leaf::kDoor) {
  std::vector<Opening> openings;
  for (const double position : positions) {
    openings.push_back({.at_m = std::abs(position - begin), .width_m = 1.0, .leaf = leaf});
  }
  return openings;
}

std::vector<Opening> Join(std::vector<Opening> a, const std::vector<Opening>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// Through the ring against the clock, with a room in the south and one in the north, and on until
// well into what it saw first.
Way FirstWay() {
  return {{6.6, 6.4},
          {14.6, 6.4},
          {14.6, 3.6},
          {16.2, 2.6},
          {14.6, 3.4},
          {14.6, 6.4},
          {31.4, 6.4},
          {31.4, 19.4},
          {20.8, 19.4},
          {20.8, 22.4},
          {22.4, 23.6},
          {20.8, 22.6},
          {20.8, 19.4},
          {6.5, 19.4},
          {6.5, 6.5},
          {13.0, 6.4}};
}

// With the clock, across the core, through a room in the west and one in the south.
Way SecondWay() {
  return {{30.8, 13.0},
          {30.8, 7.1},
          {18.0, 7.1},
          {18.0, 10.0},
          {18.0, 16.0},
          {18.0, 18.9},
          {7.2, 18.9},
          {7.1, 13.2},
          {3.4, 13.2},
          {2.4, 12.6},
          {3.2, 13.2},
          {7.1, 13.2},
          {7.1, 7.1},
          {26.0, 7.1},
          {26.0, 3.4},
          {24.8, 2.6}};
}

void AddOuterRooms(FloorPlan& plan) {
  constexpr Opening::Leaf kOpen = Opening::Leaf::kOpenDoor;
  plan.AddRoom({0.0, 0.0}, {38.0, 26.0});
  // Walls run so that their left side, to which doors open, is the room's.
  plan.AddWall(
      {kRingRight, kRingLow},
      {kRingLow, kRingLow},
      Join(DoorsAt(kRingRight, {8.2, 20.6, 30.6}), DoorsAt(kRingRight, {14.6, 26.0}, kOpen)));
  plan.AddWall({kRingRight, kRingTop}, {kRingRight, kRingLow}, DoorsAt(kRingTop, {9.1, 16.8}));
  plan.AddWall({kRingLow, kRingTop},
               {kRingRight, kRingTop},
               Join(DoorsAt(kRingLow, {9.3, 14.4, 28.8}), DoorsAt(kRingLow, {20.8}, kOpen)));
  plan.AddWall({kRingLow, kRingLow},
               {kRingLow, kRingTop},
               Join(DoorsAt(kRingLow, {8.3, 17.6}), DoorsAt(kRingLow, {13.2}, kOpen)));
  for (const double x : {5.6, 11.3, 17.9, 23.1, 29.0, 32.4}) {
    plan.AddWall({x, 0.0}, {x, kRingLow});
  }
  for (const double x : {5.6, 12.4, 16.7, 24.9, 32.4}) {
    plan.AddWall({x, kRingTop}, {x, 26.0});
  }
  for (const double y : {5.6, 11.2, 15.1, 20.4}) {
    plan.AddWall({0.0, y}, {kRingLow, y});
  }
  for (const double y : {5.6, 13.0, 20.4}) {
    plan.AddWall({kRingRight, y}, {38.0, y});
  }
}

void AddCore(FloorPlan& plan) {
  constexpr Opening::Leaf kOpen = Opening::Leaf::kOpenDoor;
  constexpr double kLow = kRingLow + kCorridorM;
  constexpr double kRight = kRingRight - kCorridorM;
  constexpr double kTop = kRingTop - kCorridorM;
  plan.AddWall({kLow, kLow},
               {kRight, kLow},
               Join(DoorsAt(kLow, {11.0, 25.2}), DoorsAt(kLow, {18.0}, kOpen)));
  plan.AddWall({kRight, kLow}, {kRight, kTop});
  plan.AddWall(
      {kRight, kTop}, {kLow, kTop}, Join(DoorsAt(kRight, {12.2}), DoorsAt(kRight, {18.0}, kOpen)));
  plan.AddWall({kLow, kTop}, {kLow, kLow});
  plan.AddWall({14.2, kLow}, {14.2, kTop});
  plan.AddWall({21.5, kLow}, {21.5, kTop});
  for (const double x : {15.4, 20.3}) {
    for (const double y : {10.4, 15.4}) {
      plan.AddColumn({{x, y}, 0.2});
    }
  }
}

void FurnishRooms(FloorPlan& plan, const std::vector<Way>& ways) {
  const std::vector<std::pair<Vector2d, Vector2d>> rooms = {{{5.6, 0.0}, {11.3, 5.6}},
                                                            {{11.3, 0.0}, {17.9, 5.6}},
                                                            {{17.9, 0.0}, {23.1, 5.6}},
                                                            {{23.1, 0.0}, {29.0, 5.6}},
                                                            {{29.0, 0.0}, {32.4, 5.6}},
                                                            {{5.6, 20.4}, {12.4, 26.0}},
                                                            {{12.4, 20.4}, {16.7, 26.0}},
                                                            {{16.7, 20.4}, {24.9, 26.0}},
                                                            {{24.9, 20.4}, {32.4, 26.0}},
                                                            {{0.0, 5.6}, {5.6, 11.2}},
                                                            {{0.0, 11.2}, {5.6, 15.1}},
                                                            {{0.0, 15.1}, {5.6, 20.4}},
                                                            {{32.4, 5.6}, {38.0, 13.0}},
                                                            {{32.4, 13.0}, {38.0, 20.4}},
                                                            {{7.9, 7.9}, {14.2, 18.1}},
                                                            {{14.2, 7.9}, {21.5, 18.1}},
                                                            {{21.5, 7.9}, {30.1, 18.1}}};
  for (std::size_t room = 0; room < rooms.size(); ++room) {
    Furnish(plan, rooms[room].first, rooms[room].second, 100 + room, ways);
  }
  // What stands in corridors, close to a wall.
  plan.AddFurniture({.centre = {23.7, 7.62}, .size_m = {1.1, 0.32}});
  plan.AddFurniture({.centre = {11.5, 20.12}, .size_m = {0.8, 0.3}});
  plan.AddFurniture({.centre = {32.1, 11.2}, .size_m = {0.32, 0.9}});
}

Scenario MakeBuilding(std::string name) {
  Scenario scenario;
  scenario.name = std::move(name);
  AddOuterRooms(scenario.plan);
  AddCore(scenario.plan);
  FurnishRooms(scenario.plan, {FirstWay(), SecondWay()});
  scenario.plan.AddPerson({.route = {{9.0, 6.9}, {29.0, 6.6}}, .phase_s = 3.0});
  scenario.plan.AddPerson({.route = {{31.5, 8.0}, {31.1, 19.0}, {24.0, 19.2}}, .phase_s = 17.0});
  scenario.plan.AddPerson({.route = {{16.0, 9.4}, {19.6, 12.6}, {16.4, 16.6}}, .speed_m_s = 0.8});
  return scenario;
}

}  // namespace

Scenario MakeOffice() {
  Scenario scenario = MakeBuilding("office");
  SessionPlan first;
  first.robot = "r1";
  first.session = "r1-1";
  first.waypoints = FirstWay();
  SessionPlan second = first;
  second.robot = "r2";
  second.session = "r2-1";
  second.waypoints = SecondWay();
  second.odometry.distance_scale = 0.985;
  second.odometry.drift_rad_m = -0.003;
  second.laser.beam_count = 361;
  second.laser.angle_step_rad = 0.5 * kPi / 180.0;
  second.laser.robot_from_laser = {0.12, 0.03, 0.0};
  scenario.sessions = {first, second};
  return scenario;
}

Scenario MakeOfficeDays() {
  Scenario scenario = MakeBuilding("office-days");
  for (std::uint64_t day = 0; day < 3; ++day) {
    SessionPlan session;
    session.robot = "r1";
    session.session = "r1-" + std::to_string(day + 1);
    session.day = day;
    session.waypoints = day % 2 == 0 ? FirstWay() : SecondWay();
    scenario.sessions.push_back(session);
  }
  return scenario;
}

}  // namespace loci::simulator
