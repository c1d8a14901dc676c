// SPDX-License-Identifier: Apache-2.0
// Snapshots for tests and benchmarks of what reads them, without an engine.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "core/engine/snapshot.h"
#include "core/mesh/mesh.h"
#include "tests/support/mesh_world.h"

namespace loci::testing {

struct WorldOptions {
  double cell_size_m = 0.05;
  int place_count = 6;    // along a line, 4 m apart
  int overlay_count = 0;  // of these, the last ones are not consolidated
  double radius_m = 6.0;  // that each place sees
  Pose2 map_from_first;
};

// What an engine would publish after a drive through the building of mesh_world.h.
inline Snapshot MakeSnapshot(const WorldOptions& options) {
  Snapshot snapshot;
  snapshot.revision = Revision{7};
  snapshot.settings.cell_size_m = options.cell_size_m;
  Mesh mesh(options.cell_size_m);
  std::vector<Pose2> poses;
  for (int i = 0; i < options.place_count; ++i) {
    const Pose2 pose = options.map_from_first * Pose2{4.0 * i, 0.5 * (i % 3), 0.2 * i};
    const PlaceId place{static_cast<std::uint32_t>(i)};
    poses.push_back(pose);
    const bool is_overlay = i >= options.place_count - options.overlay_count;
    snapshot.places.push_back({place, SessionId{0}, pose, true, !is_overlay});
    LogOddsGrid stationary = ObserveBuilding(pose, options.radius_m, options.cell_size_m);
    LogOddsGrid moving;
    for (std::int32_t x = 0; x < 12; ++x) {  // somebody walked past the place's origin
      moving.Writable({x, 2}) = 30;
      moving.Writable({x, 3}) = 30;
    }
    mesh.MovePlaces(poses);
    if (is_overlay) {
      snapshot.overlays.push_back({place, std::move(stationary), std::move(moving)});
    } else {
      mesh.Consolidate({place, SessionId{0}, i, &stationary, &moving, pose});
    }
  }
  while (mesh.HasWork()) {
    mesh.Work(100);
  }
  snapshot.mesh = mesh.TakeSnapshot();
  snapshot.closures = std::make_shared<const std::vector<ClosureSnapshot>>();
  snapshot.constraints = std::make_shared<const std::vector<ConstraintSnapshot>>();
  return snapshot;
}

}  // namespace loci::testing
