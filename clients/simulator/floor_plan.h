// SPDX-License-Identifier: Apache-2.0
// A simulated building: what stands in the way of a beam, and what of it changes.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace loci::simulator {

struct Segment {
  Eigen::Vector2d from = Eigen::Vector2d::Zero();
  Eigen::Vector2d to = Eigen::Vector2d::Zero();
};

struct Disk {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
};

// Something with a rectangular outline. Movable ones stand elsewhere every day.
struct Furniture {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  Eigen::Vector2d size_m = Eigen::Vector2d::Ones();  // along its own axes
  double angle_rad = 0.0;
  bool movable = false;
};

// A leaf in an opening. Closed, it fills the opening; open, it stands at a right angle to it.
struct Door {
  Eigen::Vector2d hinge = Eigen::Vector2d::Zero();
  Eigen::Vector2d latch = Eigen::Vector2d::Zero();
  bool always_open = false;  // a robot drives through it; others are open or shut by the day
};

// Someone who walks to and fro along a line, without end.
struct Person {
  std::vector<Eigen::Vector2d> route;
  double speed_m_s = 1.1;
  double phase_s = 0.0;
  double radius_m = 0.2;
};

// An opening in a wall: its middle, measured along the wall from its beginning.
struct Opening {
  double at_m = 0.0;
  double width_m = 1.0;
  enum class Leaf { kNone, kDoor, kOpenDoor };
  Leaf leaf = Leaf::kNone;
};

class FloorPlan {
 public:
  static constexpr double kWallThicknessM = 0.14;

  // A wall with two faces around the line from `from` to `to`, with openings.
  void AddWall(const Eigen::Vector2d& from,
               const Eigen::Vector2d& to,
               const std::vector<Opening>& openings = {});
  // Four walls.
  void AddRoom(const Eigen::Vector2d& low, const Eigen::Vector2d& high);
  void AddFurniture(const Furniture& furniture) { furniture_.push_back(furniture); }
  void AddColumn(const Disk& column) { columns_.push_back(column); }
  void AddPerson(const Person& person) { people_.push_back(person); }

  // Outlines of everything but people on a day: walls, furniture where it stands that day, door
  // leaves. The same day and seed give the same.
  std::vector<Segment> ComputeSurfaces(std::uint64_t day, std::uint64_t seed) const;
  const std::vector<Disk>& columns() const { return columns_; }

  // Where the people are at a time.
  std::vector<Disk> ComputePeople(double time_s) const;

 private:
  std::vector<Segment> walls_;
  std::vector<Furniture> furniture_;
  std::vector<Door> doors_;
  std::vector<Disk> columns_;
  std::vector<Person> people_;
};

}  // namespace loci::simulator
