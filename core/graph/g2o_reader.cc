// SPDX-License-Identifier: Apache-2.0
// Reader of pose graphs as text.
#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include "core/graph/g2o_format.h"
#include "core/graph/g2o_record.h"
#include "core/graph/information.h"
#include "core/graph/toro_tree.h"

namespace loci {
namespace {

// How many of a record's ids are those of nodes, and whether a point's follows.
struct Vertices {
  std::size_t node_count = 0;
  bool has_point = false;
};

Vertices VerticesOf(RecordKind kind) {
  switch (kind) {
    case RecordKind::kConstraint:
    case RecordKind::kConstraintOfToro:
    case RecordKind::kConstraintByRoot:
    case RecordKind::kSpaceConstraint:
      return {2, false};
    case RecordKind::kPointConstraint:
    case RecordKind::kPointConstraintByRoot:
    case RecordKind::kSpacePointConstraint:
      return {1, true};
    case RecordKind::kPosePrior:
    case RecordKind::kPositionPrior:
    case RecordKind::kSpacePosePrior:
    case RecordKind::kSpacePositionPrior:
      return {1, false};
    default:
      return {};
  }
}

class Reader {
 public:
  Status ReadLine(std::size_t line, const std::vector<std::string_view>& words);
  StatusOr<G2oGraph> Finish() &&;

 private:
  struct Vertex {
    RecordKind kind;
    std::uint32_t index;
  };

  Status RequireOneDimension(const Record& record);
  Status AddVertex(const Record& record);
  Status AddOffset(const Record& record);
  void SeparateLandmarks();
  void MakeVertices();
  StatusOr<std::uint32_t> Find(const Record& record, std::int64_t id, RecordKind kind) const;
  StatusOr<Pose3> FindOffset(const Record& record, std::int64_t id) const;
  Status AddTerm(const Record& record);
  Status AddConstraint(const Record& record);
  Status AddPointConstraint(const Record& record);
  Status AddPrior(const Record& record);
  Status AddSpaceConstraint(const Record& record);
  Status AddSpacePointConstraint(const Record& record);
  Status AddSpacePrior(const Record& record);
  Status ApplyFix(const Record& fix);
  void PlaceVertices(bool place_nodes, bool place_points);

  G2oGraph graph_;
  std::map<std::int64_t, Vertex> vertices_;
  std::map<std::int64_t, Pose3> offsets_;
  std::vector<Record> terms_;  // constraints and priors, whose vertices may come later
  std::vector<Record> fixes_;
  Record first_;  // that says whether the graph is of the plane or of space
  bool has_toro_vertex_ = false;
  bool nodes_given_ = false;
  bool points_given_ = false;
};

template <int kSize>
Status CheckInformation(const Record& record,
                        const Eigen::Matrix<double, kSize, kSize>& information) {
  const Status status = ValidateInformation(information, "information");
  return status.ok() ? status : LineError(record, status.message());
}

Status Reader::ReadLine(std::size_t line, const std::vector<std::string_view>& words) {
  const RecordLayout* layout = FindRecordLayout(words.front());
  if (layout == nullptr) {
    ++graph_.skipped[std::string(words.front())];
    return {};
  }
  LOCI_ASSIGN_OR_RETURN(Record record, ParseRecord(line, words, *layout));
  LOCI_RETURN_IF_ERROR(RequireOneDimension(record));
  if (IsVertex(record.kind)) {
    has_toro_vertex_ = has_toro_vertex_ || record.tag == "VERTEX2";
    return AddVertex(record);
  }
  if (record.kind == RecordKind::kSpaceOffset) {
    return AddOffset(record);
  }
  (record.kind == RecordKind::kFix ? fixes_ : terms_).push_back(std::move(record));
  return {};
}

Status Reader::RequireOneDimension(const Record& record) {
  if (record.kind == RecordKind::kFix) {
    return {};
  }
  if (first_.line == 0) {
    first_.line = record.line;
    first_.tag = record.tag;
    first_.kind = record.kind;
  }
  if (IsOfSpace(record.kind) == IsOfSpace(first_.kind)) {
    return {};
  }
  return LineError(record,
                   "records of the plane and of space in one file; line " +
                       std::to_string(first_.line) + " is " + std::string(first_.tag));
}

Status Reader::AddVertex(const Record& record) {
  const std::int64_t id = record.ids.front();
  const std::vector<double>& numbers = record.numbers;
  std::vector<std::int64_t>* ids = nullptr;
  switch (record.kind) {
    case RecordKind::kNode:
      ids = &graph_.node_ids;
      graph_.plane.map_from_node.push_back(PlanePose(record));
      break;
    case RecordKind::kPoint:
      ids = &graph_.point_ids;
      graph_.plane.points_in_map.emplace_back(numbers[0], numbers[1]);
      break;
    case RecordKind::kSpaceNode: {
      ids = &graph_.space_ids;
      LOCI_ASSIGN_OR_RETURN(const Pose3 pose, SpacePose(record));
      graph_.space.map_from_node.push_back(pose);
      break;
    }
    default:
      ids = &graph_.space_point_ids;
      graph_.space.points_in_map.emplace_back(numbers[0], numbers[1], numbers[2]);
      break;
  }
  const bool is_point = record.kind == RecordKind::kPoint || record.kind == RecordKind::kSpacePoint;
  (is_point ? points_given_ : nodes_given_) = true;
  const Vertex vertex{record.kind, static_cast<std::uint32_t>(ids->size())};
  ids->push_back(id);
  if (!vertices_.emplace(id, vertex).second) {
    return LineError(record, "vertex " + std::to_string(id) + " is there already");
  }
  return {};
}

Status Reader::AddOffset(const Record& record) {
  LOCI_ASSIGN_OR_RETURN(const Pose3 offset, SpacePose(record));
  if (!offsets_.emplace(record.ids.front(), offset).second) {
    return LineError(record,
                     "parameter " + std::to_string(record.ids.front()) + " is there already");
  }
  return {};
}

// iSAM counts landmarks on their own: where their ids are those of poses too, they get new ones
// behind the last.
void Reader::SeparateLandmarks() {
  std::int64_t last = 0;
  bool clash = false;
  std::set<std::int64_t> node_ids;
  for (const Record& record : terms_) {
    const Vertices vertices = VerticesOf(record.kind);
    for (std::size_t i = 0; i < vertices.node_count; ++i) {
      node_ids.insert(record.ids[i]);
    }
    for (std::size_t i = 0; i < vertices.node_count + (vertices.has_point ? 1 : 0); ++i) {
      last = std::max(last, record.ids[i]);
    }
  }
  for (const Record& record : terms_) {
    clash = clash || (record.kind == RecordKind::kPointConstraintByRoot &&
                      node_ids.count(record.ids[1]) != 0);
  }
  // An id for which there is no room stays, and is refused as one of another kind.
  const std::int64_t room = std::numeric_limits<std::int64_t>::max() - last;
  for (Record& record : terms_) {
    if (clash && record.kind == RecordKind::kPointConstraintByRoot && record.ids[1] < room) {
      record.ids[1] += last + 1;
    }
  }
}

// Vertices that only constraints and priors name, in the order of their ids: all of a kind, or
// none.
void Reader::MakeVertices() {
  std::map<std::int64_t, RecordKind> wanted;
  for (const Record& record : terms_) {
    const bool in_space = IsOfSpace(record.kind);
    const Vertices vertices = VerticesOf(record.kind);
    for (std::size_t i = 0; !nodes_given_ && i < vertices.node_count; ++i) {
      wanted.emplace(record.ids[i], in_space ? RecordKind::kSpaceNode : RecordKind::kNode);
    }
    if (!points_given_ && vertices.has_point) {
      wanted.emplace(record.ids[vertices.node_count],
                     in_space ? RecordKind::kSpacePoint : RecordKind::kPoint);
    }
  }
  for (const auto& [id, kind] : wanted) {
    if (vertices_.count(id) != 0) {
      continue;  // Find will say that its kind is wrong
    }
    std::vector<std::int64_t>& ids = kind == RecordKind::kNode        ? graph_.node_ids
                                     : kind == RecordKind::kPoint     ? graph_.point_ids
                                     : kind == RecordKind::kSpaceNode ? graph_.space_ids
                                                                      : graph_.space_point_ids;
    vertices_.emplace(id, Vertex{kind, static_cast<std::uint32_t>(ids.size())});
    ids.push_back(id);
  }
  graph_.plane.map_from_node.resize(graph_.node_ids.size());
  graph_.plane.points_in_map.resize(graph_.point_ids.size(), Eigen::Vector2d::Zero());
  graph_.space.map_from_node.resize(graph_.space_ids.size());
  graph_.space.points_in_map.resize(graph_.space_point_ids.size(), Eigen::Vector3d::Zero());
}

StatusOr<std::uint32_t> Reader::Find(const Record& record, std::int64_t id, RecordKind kind) const {
  const auto found = vertices_.find(id);
  if (found == vertices_.end()) {
    return LineError(record, "vertex " + std::to_string(id) + " has no record");
  }
  if (found->second.kind != kind) {
    return LineError(record, "vertex " + std::to_string(id) + " is of another kind");
  }
  return found->second.index;
}

StatusOr<Pose3> Reader::FindOffset(const Record& record, std::int64_t id) const {
  const auto found = offsets_.find(id);
  if (found == offsets_.end()) {
    return LineError(record, "parameter " + std::to_string(id) + " has no record PARAMS_SE3OFFSET");
  }
  return found->second;
}

Status Reader::AddTerm(const Record& record) {
  const Vertices vertices = VerticesOf(record.kind);
  if (vertices.node_count + (vertices.has_point ? 1 : 0) == 2 && record.ids[0] == record.ids[1]) {
    return LineError(record, "joins vertex " + std::to_string(record.ids[0]) + " to itself");
  }
  switch (record.kind) {
    case RecordKind::kConstraint:
    case RecordKind::kConstraintOfToro:
    case RecordKind::kConstraintByRoot:
      return AddConstraint(record);
    case RecordKind::kPointConstraint:
    case RecordKind::kPointConstraintByRoot:
      return AddPointConstraint(record);
    case RecordKind::kPosePrior:
    case RecordKind::kPositionPrior:
      return AddPrior(record);
    case RecordKind::kSpaceConstraint:
      return AddSpaceConstraint(record);
    case RecordKind::kSpacePointConstraint:
      return AddSpacePointConstraint(record);
    default:
      return AddSpacePrior(record);
  }
}

Status Reader::AddConstraint(const Record& record) {
  const double* numbers = record.numbers.data() + 3;
  GraphConstraint constraint;
  LOCI_ASSIGN_OR_RETURN(constraint.from, Find(record, record.ids[0], RecordKind::kNode));
  LOCI_ASSIGN_OR_RETURN(constraint.to, Find(record, record.ids[1], RecordKind::kNode));
  constraint.from_from_to = PlanePose(record);
  if (record.kind == RecordKind::kConstraint) {
    constraint.information = FromUpper<3>(numbers);
  } else if (record.kind == RecordKind::kConstraintOfToro && has_toro_vertex_) {
    constraint.information = FromToroOrder(numbers);
  } else {
    constraint.information = FromRoot<3>(numbers);
  }
  LOCI_RETURN_IF_ERROR(CheckInformation(record, constraint.information));
  graph_.plane.constraints.push_back(constraint);
  return {};
}

Status Reader::AddPointConstraint(const Record& record) {
  const double* numbers = record.numbers.data() + 2;
  PointConstraint constraint;
  LOCI_ASSIGN_OR_RETURN(constraint.from, Find(record, record.ids[0], RecordKind::kNode));
  LOCI_ASSIGN_OR_RETURN(constraint.point, Find(record, record.ids[1], RecordKind::kPoint));
  constraint.point_in_from = {record.numbers[0], record.numbers[1]};
  constraint.information =
      record.kind == RecordKind::kPointConstraint ? FromUpper<2>(numbers) : FromRoot<2>(numbers);
  LOCI_RETURN_IF_ERROR(CheckInformation(record, constraint.information));
  graph_.plane.point_constraints.push_back(constraint);
  return {};
}

Status Reader::AddPrior(const Record& record) {
  LOCI_ASSIGN_OR_RETURN(const std::uint32_t node, Find(record, record.ids[0], RecordKind::kNode));
  if (record.kind == RecordKind::kPosePrior) {
    PosePrior prior;
    prior.node = node;
    prior.map_from_node = PlanePose(record);
    prior.information = FromUpper<3>(record.numbers.data() + 3);
    LOCI_RETURN_IF_ERROR(CheckInformation(record, prior.information));
    graph_.plane.pose_priors.push_back(prior);
    return {};
  }
  PositionPrior prior;
  prior.node = node;
  prior.node_in_map = {record.numbers[0], record.numbers[1]};
  prior.information = FromUpper<2>(record.numbers.data() + 2);
  LOCI_RETURN_IF_ERROR(CheckInformation(record, prior.information));
  graph_.plane.position_priors.push_back(prior);
  return {};
}

Status Reader::AddSpaceConstraint(const Record& record) {
  SpaceConstraint constraint;
  LOCI_ASSIGN_OR_RETURN(constraint.from, Find(record, record.ids[0], RecordKind::kSpaceNode));
  LOCI_ASSIGN_OR_RETURN(constraint.to, Find(record, record.ids[1], RecordKind::kSpaceNode));
  LOCI_ASSIGN_OR_RETURN(constraint.from_from_to, SpacePose(record));
  constraint.information = FromUpper<6>(record.numbers.data() + 7);
  LOCI_RETURN_IF_ERROR(CheckInformation(record, constraint.information));
  graph_.space.constraints.push_back(constraint);
  return {};
}

// With P the offset: e of the file is P^-1 p - z, ours is p - P z, which is turned by R(P): chi2 is
// the same with the information turned too.
Status Reader::AddSpacePointConstraint(const Record& record) {
  SpacePointConstraint constraint;
  LOCI_ASSIGN_OR_RETURN(constraint.from, Find(record, record.ids[0], RecordKind::kSpaceNode));
  LOCI_ASSIGN_OR_RETURN(constraint.point, Find(record, record.ids[1], RecordKind::kSpacePoint));
  LOCI_ASSIGN_OR_RETURN(const Pose3 offset, FindOffset(record, record.ids[2]));
  const Eigen::Vector3d measured(record.numbers[0], record.numbers[1], record.numbers[2]);
  const Eigen::Matrix3d rotation = offset.rotation.toRotationMatrix();
  const Eigen::Matrix3d information = FromUpper<3>(record.numbers.data() + 3);
  LOCI_RETURN_IF_ERROR(CheckInformation(record, information));
  const Eigen::Matrix3d turned = rotation * information * rotation.transpose();
  constraint.point_in_from = offset.translation + rotation * measured;
  constraint.information = 0.5 * (turned + turned.transpose());
  graph_.space.point_constraints.push_back(constraint);
  return {};
}

Status Reader::AddSpacePrior(const Record& record) {
  LOCI_ASSIGN_OR_RETURN(const std::uint32_t node,
                        Find(record, record.ids[0], RecordKind::kSpaceNode));
  LOCI_ASSIGN_OR_RETURN(const Pose3 offset, FindOffset(record, record.ids[1]));
  if (record.kind == RecordKind::kSpacePosePrior) {
    SpacePosePrior prior;
    prior.node = node;
    prior.node_from_sensor = offset;
    LOCI_ASSIGN_OR_RETURN(prior.map_from_sensor, SpacePose(record));
    prior.information = FromUpper<6>(record.numbers.data() + 7);
    LOCI_RETURN_IF_ERROR(CheckInformation(record, prior.information));
    graph_.space.pose_priors.push_back(prior);
    return {};
  }
  SpacePositionPrior prior;
  prior.node = node;
  prior.node_in_map = {record.numbers[0], record.numbers[1], record.numbers[2]};
  prior.information = FromUpper<3>(record.numbers.data() + 3);
  LOCI_RETURN_IF_ERROR(CheckInformation(record, prior.information));
  graph_.space.position_priors.push_back(prior);
  return {};
}

Status Reader::ApplyFix(const Record& fix) {
  for (const std::int64_t id : fix.ids) {
    const auto found = vertices_.find(id);
    if (found == vertices_.end()) {
      return LineError(fix, "vertex " + std::to_string(id) + " has no record");
    }
    const Vertex& vertex = found->second;
    std::vector<bool>& fixed = vertex.kind == RecordKind::kNode        ? graph_.plane.fixed
                               : vertex.kind == RecordKind::kPoint     ? graph_.plane.fixed_points
                               : vertex.kind == RecordKind::kSpaceNode ? graph_.space.fixed
                                                                       : graph_.space.fixed_points;
    fixed.resize(std::max<std::size_t>(fixed.size(), vertex.index + 1));
    fixed[vertex.index] = true;
  }
  return {};
}

// Where nodes are missing, by the tree; where points are, by who sees them first, be they fixed or
// not.
void Reader::PlaceVertices(bool place_nodes, bool place_points) {
  const auto place = [&](auto& graph) {
    std::vector<bool> fixed_points = graph.fixed_points;
    if (place_points) {
      graph.fixed_points.clear();
    }
    if (place_nodes) {
      PlaceByTree(BreadthFirstTree(graph), graph);
    } else if (place_points) {
      PlacePoints(graph);
    }
    graph.fixed_points = std::move(fixed_points);
  };
  if (graph_.in_space()) {
    place(graph_.space);
  } else {
    place(graph_.plane);
  }
}

StatusOr<G2oGraph> Reader::Finish() && {
  const bool place_nodes = !nodes_given_;
  const bool place_points = !points_given_;
  if (!points_given_) {
    SeparateLandmarks();
  }
  MakeVertices();
  for (const Record& record : terms_) {
    LOCI_RETURN_IF_ERROR(AddTerm(record));
  }
  for (const Record& fix : fixes_) {
    LOCI_RETURN_IF_ERROR(ApplyFix(fix));
  }
  PlaceVertices(place_nodes, place_points);
  return std::move(graph_);
}

}  // namespace

StatusOr<G2oGraph> ParseG2o(std::string_view text) {
  Reader reader;
  for (std::size_t line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::vector<std::string_view> words = WordsOf(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!words.empty()) {
      LOCI_RETURN_IF_ERROR(reader.ReadLine(line, words));
    }
  }
  return std::move(reader).Finish();
}

}  // namespace loci
