// SPDX-License-Identifier: Apache-2.0
// The dense map: a mesh of triangles that carry layers and follow their vertices (HYMM, equation
// 2).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/base/archive.h"
#include "core/base/ids.h"
#include "core/base/state_record.h"
#include "core/base/status.h"
#include "core/geometry/se2.h"
#include "core/grid/log_odds_grid.h"
#include "core/mesh/mesh_snapshot.h"

namespace loci {

// What a finished place brings into the mesh.
struct PlaceContent {
  PlaceId place;
  SessionId session;
  std::int64_t stamp_ns = 0;  // of its last observation: older evidence is folded first
  const LogOddsGrid* stationary = nullptr;  // not null
  const LogOddsGrid* moving = nullptr;      // null: nothing moved
  Pose2 map_from_place;                     // the same as MovePlaces was last told
};

// All LTRs of a map.
//
// A vertex is an anchor: a point fixed in a place. Moving places moves vertices and, with them,
// every layer; no cell is written for that. Triangles without observed cells are topology only; an
// LTR is a triangle that has content.
//
// Positions are snapped to 2^-14 m and end at 32 km from the origin of the map: vertices beyond are
// held at that border.
//
// State: anchors, topology, contents and counters. Positions and the queue of work follow from them
// and from the poses of the places, so whoever changes a pose must call MovePlaces. Deterministic;
// not thread-safe; snapshots may be read by any thread.
class Mesh {
 public:
  // Cells have this side when they are laid out, in metres.
  explicit Mesh(double cell_size_m);
  ~Mesh();
  Mesh(Mesh&&) noexcept;
  Mesh& operator=(Mesh&&) noexcept;

  // Changes from here on belong to event `now`. For checkpoints only, not state.
  void BeginEvent(EventNumber now);

  // Says where all places are now, by PlaceId; the list may grow and never shrinks. Costs
  // O(vertices + LTRs), writes no cell. LTRs that are bent too much are queued for Work().
  void MovePlaces(std::span<const Pose2> map_from_place);

  // Places that host a vertex of a triangle (with content or not) that lies under observed cells of
  // `grid`: sorted, each once. Empty where there is no mesh yet.
  std::vector<PlaceId> HostsUnder(const LogOddsGrid& grid, const Pose2& map_from_place) const;

  // Adds anchors until every observed cell lies inside the mesh, then writes one contribution of
  // this place to each LTR with observed cells under it. A place may be consolidated once only.
  void Consolidate(const PlaceContent& content);

  // Remeshing: LTRs whose triangle is gone, turned over, thin or stretched are resampled. Works off
  // at most `ltr_count_max` of them. Never loops: without news Work() ends with HasWork() false.
  bool HasWork() const;
  void Work(std::uint32_t ltr_count_max);

  // Cells written since the map began. State.
  std::uint64_t cells_consolidated() const;
  std::uint64_t cells_remeshed() const;

  std::size_t LtrCount() const;
  std::size_t VertexCount() const;

  // The mesh as it is now. LTRs that are turned over at this moment are left out. Sheets that wait
  // for remeshing may lie over others: what readers see at a point is the sum over all LTRs there.
  // Textures that did not change are shared with the snapshot before.
  std::shared_ptr<const MeshSnapshot> TakeSnapshot();

  // All state in a defined order, without caches.
  void AddToHash(HashArchive& archive) const;

  // Kinds of the records: the mesh without content (one record, id 0), and the content of one LTR.
  static constexpr std::uint32_t kTopologyRecord = 40;
  static constexpr std::uint32_t kLtrRecord = 41;

  // Appends records that changed after event `since` (0: all), and names of those that ended.
  void AppendChanges(EventNumber since,
                     std::vector<StateRecord>& written,
                     std::vector<std::pair<std::uint32_t, std::uint64_t>>& removed) const;
  // Nobody will ask for changes since an event before `event` any more.
  void ForgetChangesUpTo(EventNumber event);

  // The mesh from its records, in any order; records of other kinds are passed over. Poses are
  // those that MovePlaces was last told. kDataLoss if the records are not those of a mesh.
  static StatusOr<Mesh> FromRecords(double cell_size_m,
                                    const std::vector<StateRecord>& records,
                                    std::span<const Pose2> map_from_place);

 private:
  class State;
  explicit Mesh(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

}  // namespace loci
