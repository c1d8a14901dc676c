// SPDX-License-Identifier: Apache-2.0
#include "clients/simulator/floor_plan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/random.h"
#include "core/geometry/se2.h"

namespace loci::simulator {
namespace {

using Eigen::Vector2d;

Vector2d LeftOf(const Vector2d& direction) {
  return {-direction.y(), direction.x()};
}

void AddOutline(const std::vector<Vector2d>& corners, std::vector<Segment>& segments) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    segments.push_back({corners[i], corners[(i + 1) % corners.size()]});
  }
}

// A box around a line.
void AddBar(const Vector2d& from, const Vector2d& to, std::vector<Segment>& segments) {
  const Vector2d side = LeftOf((to - from).normalized()) * (0.5 * FloorPlan::kWallThicknessM);
  AddOutline({from + side, from - side, to - side, to + side}, segments);
}

void AddBox(const Furniture& box, std::vector<Segment>& segments) {
  const Pose2 plan_from_box = {box.centre.x(), box.centre.y(), box.angle_rad};
  const Vector2d half = 0.5 * box.size_m;
  std::vector<Vector2d> corners;
  for (const auto& [x, y] : {std::pair{1.0, 1.0}, {-1.0, 1.0}, {-1.0, -1.0}, {1.0, -1.0}}) {
    corners.push_back(plan_from_box * Vector2d(x * half.x(), y * half.y()));
  }
  AddOutline(corners, segments);
}

// Random numbers of one thing on one day.
RandomSequence RandomOf(std::uint64_t seed, std::uint64_t day, std::uint64_t thing) {
  return RandomSequence(MixBits(MixBits(seed) + day) ^ MixBits(thing + 1));
}

}  // namespace

void FloorPlan::AddWall(const Vector2d& from,
                        const Vector2d& to,
                        const std::vector<Opening>& openings) {
  const double length_m = (to - from).norm();
  const Vector2d direction = (to - from) / length_m;
  std::vector<Opening> ordered = openings;
  std::sort(ordered.begin(), ordered.end(), [](const Opening& a, const Opening& b) {
    return a.at_m < b.at_m;
  });
  // Walls reach half their thickness beyond their ends, so that corners are shut.
  double begin_m = -0.5 * kWallThicknessM;
  for (const Opening& opening : ordered) {
    const double low_m = opening.at_m - 0.5 * opening.width_m;
    const double high_m = opening.at_m + 0.5 * opening.width_m;
    AddBar(from + begin_m * direction, from + low_m * direction, walls_);
    if (opening.leaf != Opening::Leaf::kNone) {
      doors_.push_back({.hinge = from + low_m * direction,
                        .latch = from + high_m * direction,
                        .always_open = opening.leaf == Opening::Leaf::kOpenDoor});
    }
    begin_m = high_m;
  }
  AddBar(from + begin_m * direction, to + 0.5 * kWallThicknessM * direction, walls_);
}

void FloorPlan::AddRoom(const Vector2d& low, const Vector2d& high) {
  AddWall(low, {high.x(), low.y()});
  AddWall({high.x(), low.y()}, high);
  AddWall(high, {low.x(), high.y()});
  AddWall({low.x(), high.y()}, low);
}

std::vector<Segment> FloorPlan::ComputeSurfaces(std::uint64_t day, std::uint64_t seed) const {
  std::vector<Segment> segments = walls_;
  std::uint64_t thing = 0;
  for (const Furniture& furniture : furniture_) {
    RandomSequence random = RandomOf(seed, day, thing++);
    Furniture moved = furniture;
    if (furniture.movable) {
      moved.centre += Vector2d(random.NextUniform(-0.4, 0.4), random.NextUniform(-0.4, 0.4));
      moved.angle_rad += random.NextUniform(-0.6, 0.6);
    }
    AddBox(moved, segments);
  }
  for (const Door& door : doors_) {
    RandomSequence random = RandomOf(seed, day, thing++);
    const bool open = random.NextUnit() < 0.5 || door.always_open;
    const Vector2d leaf = door.latch - door.hinge;
    segments.push_back({door.hinge, open ? door.hinge + LeftOf(leaf) : door.latch});
  }
  return segments;
}

std::vector<Disk> FloorPlan::ComputePeople(double time_s) const {
  std::vector<Disk> disks;
  for (const Person& person : people_) {
    double length_m = 0.0;
    for (std::size_t i = 1; i < person.route.size(); ++i) {
      length_m += (person.route[i] - person.route[i - 1]).norm();
    }
    // To and fro: the distance along the way, folded back at its end.
    double along_m = std::fmod((time_s + person.phase_s) * person.speed_m_s, 2.0 * length_m);
    along_m = along_m > length_m ? 2.0 * length_m - along_m : along_m;
    for (std::size_t i = 1; i < person.route.size(); ++i) {
      const Vector2d step = person.route[i] - person.route[i - 1];
      const double step_m = step.norm();
      if (along_m <= step_m || i + 1 == person.route.size()) {
        const double share = std::min(along_m / step_m, 1.0);
        disks.push_back({person.route[i - 1] + share * step, person.radius_m});
        break;
      }
      along_m -= step_m;
    }
  }
  return disks;
}

}  // namespace loci::simulator
