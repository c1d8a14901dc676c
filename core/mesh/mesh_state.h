// SPDX-License-Identifier: Apache-2.0
// Inside of Mesh: anchors, topology and content, and the rules by which content moves.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "core/mesh/delaunay.h"
#include "core/mesh/footprint.h"
#include "core/mesh/ltr.h"
#include "core/mesh/mesh.h"

namespace loci {

// A virtual vertex, fixed to a place.
struct Anchor {
  PlaceId host;
  Eigen::Vector2d point_in_place;
};

// See Mesh for what the functions of the same names promise.
//
// An LTR is named by a number that is never used again and found by its three vertices; no two have
// the same three. An LTR whose three vertices are no triangle of the topology any more is a sheet:
// it is served like the others and waits to be dissolved into the triangles under it.
class Mesh::State {
 public:
  explicit State(double cell_size_m) : cell_size_m_(cell_size_m) {}

  void BeginEvent(EventNumber now) { now_ = now; }
  void MovePlaces(std::span<const Pose2> map_from_place);
  std::vector<PlaceId> HostsUnder(const LogOddsGrid& grid, const Pose2& map_from_place) const;
  void Consolidate(const PlaceContent& content);
  bool HasWork() const;
  void Work(std::uint32_t ltr_count_max);
  std::shared_ptr<const MeshSnapshot> TakeSnapshot();

  void AddToHash(HashArchive& archive) const;
  void AppendChanges(EventNumber since,
                     std::vector<StateRecord>& written,
                     std::vector<std::pair<std::uint32_t, std::uint64_t>>& removed) const;
  void ForgetChangesUpTo(EventNumber event);
  Status ReadTopology(std::string_view bytes, std::span<const Pose2> map_from_place);
  Status ReadLtr(std::uint64_t id, std::string_view bytes);
  void FinishReading();

  std::uint64_t cells_consolidated() const { return cells_consolidated_; }
  std::uint64_t cells_remeshed() const { return cells_remeshed_; }
  std::size_t LtrCount() const { return ltrs_.size(); }
  std::size_t VertexCount() const { return anchors_.size(); }

 private:
  using LtrId = std::uint64_t;
  using Triple = std::array<std::uint32_t, 3>;  // VertexId values, sorted

  // A triangle of the topology as a place for content: vertices in the order of its cells.
  struct Target {
    std::array<VertexId, 3> vertices;
    TriangleInMap triangle;
    LtrLayout layout;  // of the LTR that is there, or the one that it would get
  };

  // mesh_state.cc: topology.
  static Triple TripleOf(const std::array<VertexId, 3>& vertices);
  std::array<VertexId, 3> VerticesOf(TriangleIndex triangle) const;
  Eigen::Vector2d PositionOf(VertexId vertex) const;
  SnappedPoint SnappedPositionOf(VertexId vertex) const;
  TriangleInMap TriangleOf(const std::array<VertexId, 3>& vertices) const;
  bool IsTurnedOver(const std::array<VertexId, 3>& vertices) const;
  void Cover(const std::vector<Eigen::Vector2d>& points_in_place, PlaceId place);
  void AddAnchorsAround(const std::set<std::array<std::int64_t, 2>>& squares,
                        std::int64_t margin,
                        PlaceId place);
  bool HasVertexWithin(const SnappedPoint& point, std::int64_t distance_units) const;
  std::vector<Eigen::Vector2d> Uncovered(const std::vector<Eigen::Vector2d>& points_in_place,
                                         PlaceId place) const;
  std::vector<TriangleIndex> TrianglesUnder(const Footprint& footprint,
                                            const Pose2& map_from_place) const;
  void TopologyChanged();
  void QueueAll();
  void Queue(LtrId id);

  // content_moves.cc: content.
  std::optional<Target> TargetOf(const std::array<VertexId, 3>& vertices) const;
  Ltr& WritableLtr(const Target& target);
  void Write(const Target& target, const PlaceContent& content);
  void Dissolve(LtrId id);
  bool IsFaithful(const Ltr& ltr) const;
  void CoverByPlace(const Ltr& sheet);
  void DissolveLayer(const Ltr& sheet, Layer layer, bool is_faithful);
  std::vector<std::pair<Target, CellMap>> TargetsUnder(const LtrLayout& layout,
                                                       const TriangleInMap& triangle) const;
  void Pour(const LtrContribution& contribution,
            bool is_base,
            Layer layer,
            const std::vector<std::pair<Target, CellMap>>& targets);
  std::array<Eigen::Vector2d, 3> InPlace(const TriangleInMap& triangle, PlaceId place) const;

  template <typename Archive>
  void VisitTopology(Archive& archive, std::vector<Triangulation::Corners>& triangles);

  // State.
  double cell_size_m_;
  std::vector<Anchor> anchors_;  // by VertexId
  Triangulation topology_;       // corner = VertexId + kSuperCount
  std::map<LtrId, Ltr> ltrs_;
  LtrId next_ltr_ = 1;
  std::uint64_t cells_consolidated_ = 0;
  std::uint64_t cells_remeshed_ = 0;

  // Told by the owner.
  std::vector<Pose2> map_from_place_;

  // Follow from the above.
  std::map<Triple, LtrId> ltr_of_triple_;
  std::vector<std::pair<Triple, TriangleIndex>> triangle_of_triple_;  // sorted, real triangles
  std::set<LtrId> to_dissolve_;
  std::set<LtrId> thin_;

  // Bookkeeping for checkpoints.
  struct Removed {
    LtrId id;
    EventNumber created;
    EventNumber removed;
  };
  EventNumber now_;
  EventNumber topology_changed_;
  std::vector<Removed> removed_;

  std::shared_ptr<const MeshSnapshot> snapshot_;  // cache; null if something changed
};

}  // namespace loci
