// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/scenario.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/base/random.h"

namespace loci::simulator {
namespace {

constexpr double kDoorM = 1.0;
constexpr double kWallM = 0.2;  // between a corridor and its rooms

double OnPlan(double value_m) {
  return kPlanUnitM * std::round(value_m / kPlanUnitM);
}

Eigen::Vector2d CenterOf(const Box& box) {
  return {0.5 * (box.x_min + box.x_max), 0.5 * (box.y_min + box.y_max)};
}

// A ring of corridors around a block, and rooms outside of it.
struct Ring {
  Box outer;
  double corridor_m = 2.0;

  Eigen::Vector2d Corner(int index) const {
    const double half = 0.5 * corridor_m;
    const bool right = index == 1 || index == 2;
    const bool top = index == 2 || index == 3;
    return {right ? outer.x_max - half : outer.x_min + half,
            top ? outer.y_max - half : outer.y_min + half};
  }
};

void AddRing(const Ring& ring, Building& building) {
  const Box& o = ring.outer;
  const double w = ring.corridor_m;
  building.free.push_back({o.x_min, o.y_min, o.x_max, o.y_min + w});
  building.free.push_back({o.x_min, o.y_max - w, o.x_max, o.y_max});
  building.free.push_back({o.x_min, o.y_min, o.x_min + w, o.y_max});
  building.free.push_back({o.x_max - w, o.y_min, o.x_max, o.y_max});
}

// A room above (side > 0) or below a corridor that runs along x, with a door in the middle.
struct RoomWithDoor {
  Box room;
  Box door;
};

RoomWithDoor AddRoom(
    double x_min, double width, double depth, double wall_y, int side, Building& building) {
  const double near = wall_y + side * kWallM;
  const double far = near + side * depth;
  RoomWithDoor added;
  added.room = {x_min, std::min(near, far), x_min + width, std::max(near, far)};
  const double door_x = OnPlan(x_min + 0.5 * (width - kDoorM));
  added.door = {door_x, std::min(wall_y, near), door_x + kDoorM, std::max(wall_y, near)};
  building.free.push_back(added.room);
  building.free.push_back(added.door);
  return added;
}

// Boxes along the walls of a room, away from its middle, where robots drive.
void Furnish(const Box& room, RandomSequence& random, Building& building) {
  const int count = 2 + static_cast<int>(random.NextUnit() * 3.0);
  for (int i = 0; i < count; ++i) {
    const double width = random.NextUniform(0.4, 1.2);
    const double depth = random.NextUniform(0.4, 0.8);
    const bool right = random.NextUnit() < 0.5;
    const double x = right ? room.x_max - 0.1 - depth : room.x_min + 0.1;
    const double y = random.NextUniform(room.y_min + 0.2, room.y_max - 0.2 - width);
    building.furniture.push_back({x, y, x + depth, y + width});
  }
}

void CloseDoor(const Box& door, Building& building) {
  const double y = 0.5 * (door.y_min + door.y_max);
  building.doors.push_back({{door.x_min, y}, {door.x_max, y}});
}

// Into a room through its door and out again, from the corridor's middle line.
void Visit(const RoomWithDoor& room, double corridor_y, std::vector<Eigen::Vector2d>& waypoints) {
  const Eigen::Vector2d door = CenterOf(room.door);
  waypoints.push_back({door.x(), corridor_y});
  waypoints.push_back({door.x(), CenterOf(room.room).y()});
  waypoints.push_back({door.x(), corridor_y});
}

// An office floor of 30 x 18 m of corridors with six rooms; rooms differ, so that it can be told
// where one is.
struct Office {
  Ring ring{{0.0, 0.0, 30.0, 18.0}, 2.0};
  std::vector<RoomWithDoor> below;
  std::vector<RoomWithDoor> above;
  Building building;
};

Office MakeOffice(std::uint64_t seed, std::uint64_t day) {
  Office office;
  AddRing(office.ring, office.building);
  RandomSequence layout(seed);
  double x = 0.4;
  while (x < 24.0) {
    const double width = OnPlan(layout.NextUniform(4.0, 7.0));
    office.below.push_back(
        AddRoom(x, width, OnPlan(layout.NextUniform(3.0, 6.0)), 0.0, -1, office.building));
    office.above.push_back(
        AddRoom(x, width, OnPlan(layout.NextUniform(3.0, 6.0)), 18.0, 1, office.building));
    x = OnPlan(x + width + layout.NextUniform(0.3, 1.5));
  }
  RandomSequence furniture(MixBits(seed) ^ day);
  for (const auto& rooms : {office.below, office.above}) {
    for (const RoomWithDoor& room : rooms) {
      Furnish(room.room, furniture, office.building);
    }
  }
  return office;
}

// Once around the ring from a corner, with visits to some rooms, and a little further, so that the
// loop closes.
Run AroundOffice(const Office& office, const std::string& robot, bool clockwise) {
  Run run;
  run.robot = robot;
  run.session = robot + "-1";
  const auto& c = office.ring;
  if (!clockwise) {
    run.waypoints = {c.Corner(0) + Eigen::Vector2d(4.0, 0.0)};
    Visit(office.below[1], c.Corner(0).y(), run.waypoints);
    run.waypoints.push_back(c.Corner(1));
    run.waypoints.push_back(c.Corner(2));
    Visit(office.above[2], c.Corner(2).y(), run.waypoints);
    run.waypoints.push_back(c.Corner(3));
    run.waypoints.push_back(c.Corner(0));
    run.waypoints.push_back(c.Corner(0) + Eigen::Vector2d(9.0, 0.0));
  } else {
    run.waypoints = {c.Corner(2) - Eigen::Vector2d(4.0, 0.0), c.Corner(2), c.Corner(1)};
    Visit(office.below[2], c.Corner(0).y(), run.waypoints);
    Visit(office.below[0], c.Corner(0).y(), run.waypoints);
    run.waypoints.push_back(c.Corner(0));
    run.waypoints.push_back(c.Corner(3));
    Visit(office.above[0], c.Corner(3).y(), run.waypoints);
    Visit(office.above[1], c.Corner(3).y(), run.waypoints);
    run.waypoints.push_back(c.Corner(2) - Eigen::Vector2d(1.0, 0.0));
    run.waypoints.push_back(c.Corner(2) - Eigen::Vector2d(1.0, 5.0));
  }
  return run;
}

Scenario OfficeScenario(std::uint64_t seed) {
  Scenario scenario;
  const Office office = MakeOffice(seed, 0);
  Day day;
  day.building = office.building;
  CloseDoor(office.above[3 % office.above.size()].door, day.building);
  day.walkers = {{{4.0, 1.4}, {26.0, 1.4}, 0.9}, {{29.2, 15.0}, {29.2, 3.0}, 1.1}};
  day.runs = {AroundOffice(office, "anna", false), AroundOffice(office, "bert", true)};
  scenario.days.push_back(std::move(day));
  return scenario;
}

Scenario TwoDaysScenario(std::uint64_t seed) {
  Scenario scenario;
  for (std::uint64_t number = 0; number < 2; ++number) {
    const Office office = MakeOffice(seed, number);
    Day day;
    day.building = office.building;
    CloseDoor((number == 0 ? office.above : office.below)[2].door, day.building);
    Run run = AroundOffice(office, "anna", false);
    if (number == 0) {  // that door is closed on the first day: straight on
      run.waypoints.erase(run.waypoints.begin() + 6, run.waypoints.begin() + 9);
    }
    run.session = "anna-" + std::to_string(number + 1);
    day.runs = {std::move(run)};
    scenario.days.push_back(std::move(day));
  }
  return scenario;
}

Scenario LoopScenario(std::uint64_t seed) {
  Scenario scenario;
  Ring ring{{0.0, 0.0, 75.0, 45.0}, 2.4};
  Day day;
  AddRing(ring, day.building);
  RandomSequence random(seed);
  for (const int side : {-1, 1}) {
    double x = 0.5;
    while (x < 66.0) {
      const double width = OnPlan(random.NextUniform(2.0, 7.0));
      AddRoom(x,
              width,
              OnPlan(random.NextUniform(1.0, 5.0)),
              side < 0 ? 0.0 : 45.0,
              side,
              day.building);
      x = OnPlan(x + width + random.NextUniform(0.3, 4.0));
    }
  }
  for (double y = 4.0; y < 40.0; y = OnPlan(y + random.NextUniform(2.0, 6.0))) {  // alcoves
    const double depth = OnPlan(random.NextUniform(0.3, 1.5));
    day.building.free.push_back({-depth, y, 0.0, OnPlan(y + random.NextUniform(0.6, 1.8))});
    day.building.free.push_back({75.0, y, 75.0 + depth, OnPlan(y + random.NextUniform(0.6, 1.8))});
  }
  Run run;
  run.robot = "anna";
  run.session = "anna-1";
  run.waypoints = {ring.Corner(0) + Eigen::Vector2d(5.0, 0.0),
                   ring.Corner(1),
                   ring.Corner(2),
                   ring.Corner(3),
                   ring.Corner(0),
                   ring.Corner(0) + Eigen::Vector2d(25.0, 0.0)};
  day.runs = {std::move(run)};
  scenario.days.push_back(std::move(day));
  scenario.sensors.odometry_scale = 0.05;
  scenario.sensors.heading_bias_per_m = 0.015;
  scenario.sensors.heading_noise_per_m = 0.01;
  return scenario;
}

// Three corridors that are the same to the last door, joined at both ends, with the same rooms: one
// place looks like a dozen others.
Scenario SelfSimilarScenario(std::uint64_t /*seed*/) {
  Scenario scenario;
  Day day;
  constexpr double kPitch = 5.0;
  constexpr double kLength = 50.0;
  constexpr double kFloor = 14.0;
  for (int floor = 0; floor < 3; ++floor) {
    const double y = kFloor * floor;
    day.building.free.push_back({0.0, y, kLength, y + 2.0});
    for (double x = 2.5; x + 4.0 < kLength - 2.0; x += kPitch) {
      AddRoom(x, 4.0, 3.5, y, -1, day.building);
      AddRoom(x, 4.0, 3.5, y + 2.0, 1, day.building);
    }
  }
  day.building.free.push_back({0.0, 0.0, 2.0, 2.0 * kFloor + 2.0});
  day.building.free.push_back({kLength - 2.0, 0.0, kLength, 2.0 * kFloor + 2.0});
  Run run;
  run.robot = "anna";
  run.session = "anna-1";
  run.waypoints = {{1.0, 1.0},
                   {49.0, 1.0},
                   {49.0, 15.0},
                   {1.0, 15.0},
                   {1.0, 29.0},
                   {49.0, 29.0},
                   {49.0, 15.0},
                   {1.0, 15.0},
                   {1.0, 1.0},
                   {20.0, 1.0}};
  day.runs = {std::move(run)};
  scenario.days.push_back(std::move(day));
  return scenario;
}

Scenario LongCorridorScenario(std::uint64_t /*seed*/) {
  Scenario scenario;
  Day day;
  day.building.free = {{0.0, 0.0, 120.0, 2.4}, {-4.0, -3.0, 0.0, 5.0}, {120.0, -2.0, 126.0, 4.0}};
  Run run;
  run.robot = "anna";
  run.session = "anna-1";
  run.waypoints = {{-2.0, 1.2}, {123.0, 1.2}, {-1.0, 1.2}};
  day.runs = {std::move(run)};
  scenario.days.push_back(std::move(day));
  return scenario;
}

struct Maker {
  const char* name;
  const char* description;
  Scenario (*make)(std::uint64_t seed);
};

constexpr Maker kMakers[] = {
    {"office",
     "two robots at once on one floor with a loop of 88 m, rooms and people",
     OfficeScenario},
    {"two-days",
     "one robot on two days: furniture has moved, other doors are open",
     TwoDaysScenario},
    {"loop", "one robot, a loop of 230 m, bad odometry", LoopScenario},
    {"self-similar", "three corridors with rooms that are all the same", SelfSimilarScenario},
    {"long-corridor", "120 m of bare corridor, there and back", LongCorridorScenario},
};

}  // namespace

std::vector<ScenarioEntry> ListScenarios() {
  std::vector<ScenarioEntry> entries;
  for (const Maker& maker : kMakers) {
    entries.push_back({maker.name, maker.description});
  }
  return entries;
}

StatusOr<Scenario> MakeScenario(const std::string& name, std::uint64_t seed) {
  std::string names;
  for (const Maker& maker : kMakers) {
    if (name == maker.name) {
      Scenario scenario = maker.make(seed);
      scenario.name = maker.name;
      scenario.description = maker.description;
      return scenario;
    }
    names += (names.empty() ? "" : ", ") + std::string(maker.name);
  }
  return NotFoundError("scenario: " + name + " is unknown; there are " + names);
}

}  // namespace loci::simulator
