// SPDX-License-Identifier: Apache-2.0
// What readers see: an immutable, consistent state of a map at one revision.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/ids.h"
#include "core/engine/settings.h"
#include "core/geometry/covariance.h"
#include "core/geometry/se2.h"
#include "core/grid/log_odds_grid.h"
#include "core/mesh/mesh_snapshot.h"

namespace loci {

// Cells of dense layers written since the map began, by cause. A closure writes none (HYMM).
struct CellsWritten {
  std::uint64_t integrate = 0;
  std::uint64_t consolidate = 0;
  std::uint64_t remesh = 0;
  std::uint64_t closure = 0;
};

template <typename Archive>
void Fields(Archive& archive, CellsWritten& cells) {
  archive(cells.integrate, cells.consolidate, cells.remesh, cells.closure);
}

// One pose of a trajectory: of the robot's base, kept relative to its place so that it follows.
struct TrajectoryPose {
  std::int64_t stamp_ns = 0;
  PlaceId place;
  Pose2 place_from_robot;
};

template <typename Archive>
void Fields(Archive& archive, TrajectoryPose& pose) {
  archive(pose.stamp_ns, pose.place, pose.place_from_robot);
}

// Poses in order of arrival, in pieces that snapshots share.
using TrajectoryPiece = std::vector<TrajectoryPose>;

struct SessionSnapshot {
  SessionId id;
  std::string session;
  std::string robot;
  Pose2 map_from_start;  // as the session was opened
  bool open = true;
  std::uint64_t accepted_count = 0;
  std::uint64_t refused_count = 0;
  std::uint64_t last_number = 0;  // of the last applied observation, accepted or refused
  std::int64_t first_stamp_ns = 0;
  std::int64_t last_stamp_ns = 0;
  Pose2 map_from_robot;  // at the last observation
  Pose2 map_from_odom;   // odom: the robot's dead reckoning, at the identity when the session began
  std::vector<std::shared_ptr<const TrajectoryPiece>> trajectory;
};

// A place whose grids are not consolidated yet: served as a rigid picture on top of the mesh.
struct OverlaySnapshot {
  PlaceId place;
  LogOddsGrid stationary;
  LogOddsGrid moving;
};

struct PlaceSnapshot {
  PlaceId id;
  SessionId session;
  Pose2 map_from_place;
  bool finished = false;
  bool consolidated = false;
};

enum class ClosureState : std::uint8_t { kProvisional = 0, kAccepted = 1, kRejected = 2 };

// A loop closure with the evidence for it (design.md, section 4.9).
struct ClosureSnapshot {
  ClosureId id;
  PlaceId from;
  PlaceId to;
  ClosureState state = ClosureState::kProvisional;
  Pose2 from_from_to;                   // measured
  Eigen::Matrix3d covariance;           // of from_from_to: (x, y, theta), right perturbation
  double hausdorff_fraction = 0.0;      // test 2
  double overlap_m2 = 0.0;              // test 2
  double free_conflict_fraction = 0.0;  // test 3
  double second_peak_ratio = 0.0;       // test 4
  double correction_m = 0.0;            // test 5
  double chi2 = 0.0;                    // test 6
  std::string reason;                   // why it is not accepted; empty if it is
};

// An edge of the pose graph, for those who want to see it.
struct ConstraintSnapshot {
  PlaceId from;
  PlaceId to;
  bool closure = false;
  Pose2 from_from_to;
  Eigen::Matrix3d information;
};

// Never changes after it was made; any thread may read it.
struct Snapshot {
  Revision revision;
  MapSettings settings;
  std::vector<SessionSnapshot> sessions;                               // by SessionId
  std::vector<PlaceSnapshot> places;                                   // by PlaceId
  std::vector<OverlaySnapshot> overlays;                               // in order of PlaceId
  std::shared_ptr<const MeshSnapshot> mesh;                            // never null
  std::shared_ptr<const std::vector<ClosureSnapshot>> closures;        // never null
  std::shared_ptr<const std::vector<ConstraintSnapshot>> constraints;  // never null
  CellsWritten cells_written;
  std::uint32_t closures_accepted = 0;
  double chi2 = 0.0;  // of the pose graph
};

}  // namespace loci
