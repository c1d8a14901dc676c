// SPDX-License-Identifier: Apache-2.0
#include "core/mesh/mesh.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/base/check.h"
#include "core/mesh/mesh_state.h"

namespace loci {

Mesh::Mesh(double cell_size_m) : state_(std::make_unique<State>(cell_size_m)) {
  LOCI_CHECK(cell_size_m > 0.0);
}
Mesh::Mesh(std::unique_ptr<State> state) : state_(std::move(state)) {}
Mesh::~Mesh() = default;
Mesh::Mesh(Mesh&&) noexcept = default;
Mesh& Mesh::operator=(Mesh&&) noexcept = default;

void Mesh::BeginEvent(EventNumber now) {
  state_->BeginEvent(now);
}

void Mesh::MovePlaces(std::span<const Pose2> map_from_place) {
  state_->MovePlaces(map_from_place);
}

std::vector<PlaceId> Mesh::HostsUnder(const LogOddsGrid& grid, const Pose2& map_from_place) const {
  return state_->HostsUnder(grid, map_from_place);
}

void Mesh::Consolidate(const PlaceContent& content) {
  state_->Consolidate(content);
}

bool Mesh::HasWork() const {
  return state_->HasWork();
}

void Mesh::Work(std::uint32_t ltr_count_max) {
  state_->Work(ltr_count_max);
}

std::uint64_t Mesh::cells_consolidated() const {
  return state_->cells_consolidated();
}

std::uint64_t Mesh::cells_remeshed() const {
  return state_->cells_remeshed();
}

std::size_t Mesh::LtrCount() const {
  return state_->LtrCount();
}

std::size_t Mesh::VertexCount() const {
  return state_->VertexCount();
}

std::shared_ptr<const MeshSnapshot> Mesh::TakeSnapshot() {
  return state_->TakeSnapshot();
}

void Mesh::AddToHash(HashArchive& archive) const {
  state_->AddToHash(archive);
}

void Mesh::AppendChanges(EventNumber since,
                         std::vector<StateRecord>& written,
                         std::vector<std::pair<std::uint32_t, std::uint64_t>>& removed) const {
  state_->AppendChanges(since, written, removed);
}

void Mesh::ForgetChangesUpTo(EventNumber event) {
  state_->ForgetChangesUpTo(event);
}

StatusOr<Mesh> Mesh::FromRecords(double cell_size_m,
                                 const std::vector<StateRecord>& records,
                                 std::span<const Pose2> map_from_place) {
  auto state = std::make_unique<State>(cell_size_m);
  const auto is_topology = [](const StateRecord& record) { return record.kind == kTopologyRecord; };
  const auto topology = std::find_if(records.begin(), records.end(), is_topology);
  if (topology == records.end()) {
    return DataLossError("mesh: the record of its topology is missing");
  }
  if (topology->id != 0 || std::count_if(records.begin(), records.end(), is_topology) > 1) {
    return DataLossError("mesh: more than one record of its topology");
  }
  LOCI_RETURN_IF_ERROR(state->ReadTopology(topology->bytes, map_from_place));
  for (const StateRecord& record : records) {
    Status status = record.kind == kLtrRecord ? state->ReadLtr(record.id, record.bytes) : Status();
    if (!status.ok()) {
      return status;
    }
  }
  state->FinishReading();
  return Mesh(std::move(state));
}

template <typename Archive>
void Mesh::State::VisitTopology(Archive& archive, std::vector<Triangulation::Corners>& triangles) {
  auto anchor_count = static_cast<std::uint32_t>(anchors_.size());
  archive(next_ltr_, cells_consolidated_, cells_remeshed_, triangles, anchor_count);
  for (std::uint32_t i = 0; i < anchor_count; ++i) {
    if constexpr (Archive::kReads) {
      if (archive.failed()) {  // before a count that cannot be becomes memory
        return;
      }
      anchors_.emplace_back();
    }
    archive(anchors_[i].host, anchors_[i].point_in_place.x(), anchors_[i].point_in_place.y());
  }
}

void Mesh::State::AddToHash(HashArchive& archive) const {
  std::vector<Triangulation::Corners> triangles;
  for (const Triangulation::Triangle& triangle : topology_.triangles()) {
    triangles.push_back(triangle.corners);
  }
  // VisitTopology changes nothing in an archive that writes.
  const_cast<State*>(this)->VisitTopology(archive, triangles);
  archive(static_cast<std::uint64_t>(ltrs_.size()));
  for (const auto& [id, ltr] : ltrs_) {
    archive(id);
    loci::AddToHash(archive, ltr);
  }
}

void Mesh::State::AppendChanges(
    EventNumber since,
    std::vector<StateRecord>& written,
    std::vector<std::pair<std::uint32_t, std::uint64_t>>& removed) const {
  const bool all = since.value == 0;
  if (all || topology_changed_ > since) {
    BinaryWriter writer;
    std::vector<Triangulation::Corners> triangles;
    for (const Triangulation::Triangle& triangle : topology_.triangles()) {
      triangles.push_back(triangle.corners);
    }
    const_cast<State*>(this)->VisitTopology(writer, triangles);
    written.push_back({kTopologyRecord, 0, writer.TakeBytes()});
  }
  for (const auto& [id, ltr] : ltrs_) {
    if (all || ltr.changed > since) {
      written.push_back({kLtrRecord, id, EncodeLtr(ltr)});
    }
  }
  for (const Removed& gone : removed_) {
    // One that came and went since then was never stored.
    if (gone.removed > since && gone.created <= since && !all) {
      removed.emplace_back(kLtrRecord, gone.id);
    }
  }
}

void Mesh::State::ForgetChangesUpTo(EventNumber event) {
  std::erase_if(removed_, [&](const Removed& gone) { return gone.removed <= event; });
}

Status Mesh::State::ReadTopology(std::string_view bytes, std::span<const Pose2> map_from_place) {
  BinaryReader reader(bytes);
  std::vector<Triangulation::Corners> triangles;
  VisitTopology(reader, triangles);
  LOCI_RETURN_IF_ERROR(reader.Finish("mesh"));
  map_from_place_.assign(map_from_place.begin(), map_from_place.end());
  std::vector<SnappedPoint> points;
  for (const Anchor& anchor : anchors_) {
    if (anchor.host.value >= map_from_place.size()) {
      return DataLossError("mesh: anchor of place " + std::to_string(anchor.host.value) +
                           ", there are " + std::to_string(map_from_place.size()));
    }
    if (!anchor.point_in_place.allFinite()) {
      return DataLossError("mesh: the position of an anchor is not finite");
    }
    points.push_back(Snap(Transformer2(map_from_place[anchor.host.value]) * anchor.point_in_place));
  }
  LOCI_ASSIGN_OR_RETURN(topology_, Triangulation::FromTriangles(std::move(points), triangles));
  return {};
}

Status Mesh::State::ReadLtr(LtrId id, std::string_view bytes) {
  if (id == 0 || id >= next_ltr_) {
    return DataLossError("mesh: LTR " + std::to_string(id) + ", numbers end before " +
                         std::to_string(next_ltr_));
  }
  LOCI_ASSIGN_OR_RETURN(Ltr ltr, DecodeLtr(bytes, anchors_.size()));
  const auto has_unknown_place = [&](const LtrLayer& layer) {
    const auto is_unknown = [&](const LtrContribution& contribution) {
      return contribution.place.value >= map_from_place_.size();
    };
    return (layer.base().has_value() && is_unknown(*layer.base())) ||
           std::any_of(layer.contributions().begin(), layer.contributions().end(), is_unknown);
  };
  if (std::any_of(ltr.layers.begin(), ltr.layers.end(), has_unknown_place)) {
    return DataLossError("mesh: LTR " + std::to_string(id) + " has a contribution of a place " +
                         "that does not exist");
  }
  if (!ltr_of_triple_.emplace(TripleOf(ltr.vertices), id).second ||
      !ltrs_.emplace(id, std::move(ltr)).second) {
    return DataLossError("mesh: LTR " + std::to_string(id) + " is there twice");
  }
  return {};
}

void Mesh::State::FinishReading() {
  TopologyChanged();  // now_ is 0: nothing counts as changed
}

}  // namespace loci
