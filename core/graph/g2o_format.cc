// SPDX-License-Identifier: Apache-2.0
// Reader and writer of pose graphs as text.
#include "core/graph/g2o_format.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "core/graph/information.h"
#include "core/graph/toro_tree.h"

namespace loci {
namespace {

enum class VertexKind : std::uint8_t { kNode, kPoint, kSpaceNode };
enum class EdgeKind : std::uint8_t { kPlane, kPlaneToro, kPlaneRoot, kPoint, kPointRoot, kSpace };

struct VertexTag {
  std::string_view tag;
  VertexKind kind;
  std::size_t number_count;
};
constexpr std::array<VertexTag, 4> kVertexTags = {{{"VERTEX_SE2", VertexKind::kNode, 3},
                                                   {"VERTEX2", VertexKind::kNode, 3},
                                                   {"VERTEX_XY", VertexKind::kPoint, 2},
                                                   {"VERTEX_SE3:QUAT", VertexKind::kSpaceNode, 7}}};

struct EdgeTag {
  std::string_view tag;
  EdgeKind kind;
  std::size_t number_count;
};
constexpr std::array<EdgeTag, 6> kEdgeTags = {{{"EDGE_SE2", EdgeKind::kPlane, 9},
                                               {"EDGE2", EdgeKind::kPlaneToro, 9},
                                               {"ODOMETRY", EdgeKind::kPlaneRoot, 9},
                                               {"EDGE_SE2_XY", EdgeKind::kPoint, 5},
                                               {"LANDMARK", EdgeKind::kPointRoot, 5},
                                               {"EDGE_SE3:QUAT", EdgeKind::kSpace, 28}}};

// A vertex or an edge as it stands in the file.
struct Record {
  std::size_t line = 0;
  std::string_view tag;
  std::vector<std::int64_t> ids;
  std::vector<double> numbers;
};

template <typename Number>
std::optional<Number> ParseNumber(std::string_view word) {
  if (word.size() > 1 && word.front() == '+') {
    word.remove_prefix(1);
  }
  Number number{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error != std::errc() || end != word.data() + word.size()) {
    return std::nullopt;
  }
  return number;
}

std::vector<std::string_view> WordsOf(std::string_view line) {
  constexpr std::string_view kBlanks = " \t\r\v\f";
  std::vector<std::string_view> words;
  for (std::size_t begin = line.find_first_not_of(kBlanks); begin != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kBlanks, end);
  }
  return words;
}

std::string Quoted(std::string_view text) {
  std::string quoted = "\"";
  quoted += text;
  return quoted += '"';
}

Status LineError(const Record& record, const std::string& what) {
  return InvalidArgumentError("line " + std::to_string(record.line) + ": " +
                              std::string(record.tag) + ": " + what);
}

// Reads `id_count` ids and `number_count` numbers after the tag.
StatusOr<Record> ParseRecord(std::size_t line,
                             const std::vector<std::string_view>& words,
                             std::size_t id_count,
                             std::size_t number_count) {
  Record record{line, words.front(), {}, {}};
  if (words.size() != 1 + id_count + number_count) {
    return LineError(record,
                     std::to_string(words.size() - 1) + " fields, must be " +
                         std::to_string(id_count + number_count));
  }
  for (std::size_t i = 1; i <= id_count; ++i) {
    const std::optional<std::int64_t> id = ParseNumber<std::int64_t>(words[i]);
    if (!id.has_value()) {
      return LineError(record, Quoted(words[i]) + " is no vertex id");
    }
    record.ids.push_back(*id);
  }
  for (std::size_t i = 1 + id_count; i < words.size(); ++i) {
    const std::optional<double> number = ParseNumber<double>(words[i]);
    if (!number.has_value() || !std::isfinite(*number)) {
      return LineError(record, Quoted(words[i]) + " is no finite number");
    }
    record.numbers.push_back(*number);
  }
  return record;
}

// A symmetric matrix from its upper triangle, row by row.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> FromUpper(const double* numbers) {
  Eigen::Matrix<double, kSize, kSize> matrix;
  for (int row = 0; row < kSize; ++row) {
    for (int column = row; column < kSize; ++column) {
      matrix(row, column) = *numbers;
      matrix(column, row) = *numbers++;
    }
  }
  return matrix;
}

// R^T R from R's upper triangle.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> FromRoot(const double* numbers) {
  const Eigen::Matrix<double, kSize, kSize> root =
      FromUpper<kSize>(numbers).template triangularView<Eigen::Upper>();
  return root.transpose() * root;
}

Eigen::Matrix3d FromToroOrder(const double* n) {
  const std::array<double, 6> upper = {n[0], n[1], n[4], n[2], n[5], n[3]};
  return FromUpper<3>(upper.data());
}

Pose2 PlanePose(const std::vector<double>& numbers) {
  return {numbers[0], numbers[1], WrapAngle(numbers[2])};
}

StatusOr<Pose3> SpacePose(const Record& record) {
  const std::vector<double>& n = record.numbers;
  const Eigen::Quaterniond rotation(n[6], n[3], n[4], n[5]);
  if (!(rotation.norm() > 1e-3) || !std::isfinite(rotation.norm())) {
    return LineError(record, "the quaternion's norm must be near 1");
  }
  return Pose3{{n[0], n[1], n[2]}, rotation.normalized()};
}

class Reader {
 public:
  Status ReadLine(std::size_t line, const std::vector<std::string_view>& words);
  StatusOr<G2oGraph> Finish() &&;

 private:
  struct Vertex {
    VertexKind kind;
    std::uint32_t index;
  };
  struct Edge {
    EdgeKind kind;
    Record record;
  };

  Status AddVertex(VertexKind kind, const Record& record);
  void SeparateLandmarks();
  void MakeVertices();
  StatusOr<std::uint32_t> Find(const Record& record, std::int64_t id, VertexKind kind) const;
  Status AddEdge(const Edge& edge);
  Status AddPlaneEdge(const Edge& edge);
  Status AddPointEdge(const Edge& edge);
  Status AddSpaceEdge(const Edge& edge);
  Status ApplyFix(const Record& fix);

  G2oGraph graph_;
  std::map<std::int64_t, Vertex> vertices_;
  std::vector<Edge> edges_;
  std::vector<Record> fixes_;
  bool has_toro_vertex_ = false;
  bool nodes_given_ = false;
  bool points_given_ = false;
};

Status Reader::ReadLine(std::size_t line, const std::vector<std::string_view>& words) {
  const std::string_view tag = words.front();
  if (tag == "FIX") {
    LOCI_ASSIGN_OR_RETURN(Record fix, ParseRecord(line, words, words.size() - 1, 0));
    fixes_.push_back(std::move(fix));
    return {};
  }
  for (const VertexTag& known : kVertexTags) {
    if (tag == known.tag) {
      has_toro_vertex_ = has_toro_vertex_ || tag == "VERTEX2";
      LOCI_ASSIGN_OR_RETURN(const Record record, ParseRecord(line, words, 1, known.number_count));
      return AddVertex(known.kind, record);
    }
  }
  for (const EdgeTag& known : kEdgeTags) {
    if (tag == known.tag) {
      LOCI_ASSIGN_OR_RETURN(Record record, ParseRecord(line, words, 2, known.number_count));
      edges_.push_back({known.kind, std::move(record)});
      return {};
    }
  }
  ++graph_.skipped[std::string(tag)];
  return {};
}

Status Reader::AddVertex(VertexKind kind, const Record& record) {
  const std::int64_t id = record.ids.front();
  std::size_t index = 0;
  switch (kind) {
    case VertexKind::kNode:
      index = graph_.node_ids.size();
      graph_.node_ids.push_back(id);
      graph_.plane.map_from_node.push_back(PlanePose(record.numbers));
      nodes_given_ = true;
      break;
    case VertexKind::kPoint:
      index = graph_.point_ids.size();
      graph_.point_ids.push_back(id);
      graph_.plane.points_in_map.emplace_back(record.numbers[0], record.numbers[1]);
      points_given_ = true;
      break;
    case VertexKind::kSpaceNode: {
      LOCI_ASSIGN_OR_RETURN(const Pose3 pose, SpacePose(record));
      index = graph_.space_ids.size();
      graph_.space_ids.push_back(id);
      graph_.space.map_from_node.push_back(pose);
      nodes_given_ = true;
      break;
    }
  }
  if (!vertices_.emplace(id, Vertex{kind, static_cast<std::uint32_t>(index)}).second) {
    return LineError(record, "vertex " + std::to_string(id) + " is there already");
  }
  return {};
}

// iSAM counts landmarks on their own: where their ids are those of poses too, they get new ones
// behind the last.
void Reader::SeparateLandmarks() {
  std::int64_t last = 0;
  bool clash = false;
  std::set<std::int64_t> pose_ids;
  for (const Edge& edge : edges_) {
    last = std::max({last, edge.record.ids[0], edge.record.ids[1]});
    pose_ids.insert(edge.record.ids[0]);
    if (edge.kind != EdgeKind::kPoint && edge.kind != EdgeKind::kPointRoot) {
      pose_ids.insert(edge.record.ids[1]);
    }
  }
  for (const Edge& edge : edges_) {
    clash = clash || (edge.kind == EdgeKind::kPointRoot && pose_ids.count(edge.record.ids[1]) != 0);
  }
  for (Edge& edge : edges_) {
    if (clash && edge.kind == EdgeKind::kPointRoot) {
      edge.record.ids[1] += last + 1;
    }
  }
}

// Vertices that only edges name, in the order of their ids: all of a kind, or none.
void Reader::MakeVertices() {
  std::map<std::int64_t, VertexKind> wanted;
  for (const Edge& edge : edges_) {
    const bool in_space = edge.kind == EdgeKind::kSpace;
    const bool to_point = edge.kind == EdgeKind::kPoint || edge.kind == EdgeKind::kPointRoot;
    const VertexKind node_kind = in_space ? VertexKind::kSpaceNode : VertexKind::kNode;
    if (!nodes_given_) {
      wanted.emplace(edge.record.ids[0], node_kind);
    }
    if (to_point ? !points_given_ : !nodes_given_) {
      wanted.emplace(edge.record.ids[1], to_point ? VertexKind::kPoint : node_kind);
    }
  }
  for (const auto& [id, kind] : wanted) {
    if (vertices_.count(id) != 0) {
      continue;  // Find will say that its kind is wrong
    }
    const bool is_node = kind == VertexKind::kNode;
    std::vector<std::int64_t>& ids = is_node                      ? graph_.node_ids
                                     : kind == VertexKind::kPoint ? graph_.point_ids
                                                                  : graph_.space_ids;
    vertices_.emplace(id, Vertex{kind, static_cast<std::uint32_t>(ids.size())});
    ids.push_back(id);
  }
  graph_.plane.map_from_node.resize(graph_.node_ids.size());
  graph_.plane.points_in_map.resize(graph_.point_ids.size(), Eigen::Vector2d::Zero());
  graph_.space.map_from_node.resize(graph_.space_ids.size());
}

StatusOr<std::uint32_t> Reader::Find(const Record& record, std::int64_t id, VertexKind kind) const {
  const auto found = vertices_.find(id);
  if (found == vertices_.end()) {
    return LineError(record, "vertex " + std::to_string(id) + " has no record");
  }
  if (found->second.kind != kind) {
    return LineError(record, "vertex " + std::to_string(id) + " is of another kind");
  }
  return found->second.index;
}

Status Reader::AddEdge(const Edge& edge) {
  const Record& record = edge.record;
  if (record.ids[0] == record.ids[1]) {
    return LineError(record, "joins vertex " + std::to_string(record.ids[0]) + " to itself");
  }
  switch (edge.kind) {
    case EdgeKind::kPlane:
    case EdgeKind::kPlaneToro:
    case EdgeKind::kPlaneRoot:
      return AddPlaneEdge(edge);
    case EdgeKind::kPoint:
    case EdgeKind::kPointRoot:
      return AddPointEdge(edge);
    case EdgeKind::kSpace:
      return AddSpaceEdge(edge);
  }
  return {};
}

Status Reader::AddPlaneEdge(const Edge& edge) {
  const Record& record = edge.record;
  const double* numbers = record.numbers.data() + 3;
  GraphConstraint constraint;
  LOCI_ASSIGN_OR_RETURN(constraint.from, Find(record, record.ids[0], VertexKind::kNode));
  LOCI_ASSIGN_OR_RETURN(constraint.to, Find(record, record.ids[1], VertexKind::kNode));
  constraint.from_from_to = PlanePose(record.numbers);
  if (edge.kind == EdgeKind::kPlane) {
    constraint.information = FromUpper<3>(numbers);
  } else if (edge.kind == EdgeKind::kPlaneToro && has_toro_vertex_) {
    constraint.information = FromToroOrder(numbers);
  } else {
    constraint.information = FromRoot<3>(numbers);
  }
  if (const Status status = ValidateInformation(constraint.information, "information");
      !status.ok()) {
    return LineError(record, status.message());
  }
  graph_.plane.constraints.push_back(constraint);
  return {};
}

Status Reader::AddPointEdge(const Edge& edge) {
  const Record& record = edge.record;
  const double* numbers = record.numbers.data() + 2;
  PointConstraint constraint;
  LOCI_ASSIGN_OR_RETURN(constraint.from, Find(record, record.ids[0], VertexKind::kNode));
  LOCI_ASSIGN_OR_RETURN(constraint.point, Find(record, record.ids[1], VertexKind::kPoint));
  constraint.point_in_from = {record.numbers[0], record.numbers[1]};
  constraint.information =
      edge.kind == EdgeKind::kPoint ? FromUpper<2>(numbers) : FromRoot<2>(numbers);
  if (const Status status = ValidateInformation(constraint.information, "information");
      !status.ok()) {
    return LineError(record, status.message());
  }
  graph_.plane.point_constraints.push_back(constraint);
  return {};
}

Status Reader::AddSpaceEdge(const Edge& edge) {
  const Record& record = edge.record;
  SpaceConstraint constraint;
  LOCI_ASSIGN_OR_RETURN(constraint.from, Find(record, record.ids[0], VertexKind::kSpaceNode));
  LOCI_ASSIGN_OR_RETURN(constraint.to, Find(record, record.ids[1], VertexKind::kSpaceNode));
  LOCI_ASSIGN_OR_RETURN(constraint.from_from_to, SpacePose(record));
  constraint.information = FromUpper<6>(record.numbers.data() + 7);
  if (const Status status = ValidateInformation(constraint.information, "information");
      !status.ok()) {
    return LineError(record, status.message());
  }
  graph_.space.constraints.push_back(constraint);
  return {};
}

Status Reader::ApplyFix(const Record& fix) {
  graph_.plane.fixed.resize(graph_.node_ids.size());
  graph_.space.fixed.resize(graph_.space_ids.size());
  for (const std::int64_t id : fix.ids) {
    const auto found = vertices_.find(id);
    if (found == vertices_.end()) {
      return LineError(fix, "vertex " + std::to_string(id) + " has no record");
    }
    if (found->second.kind == VertexKind::kPoint) {
      return UnimplementedError("line " + std::to_string(fix.line) + ": FIX: vertex " +
                                std::to_string(id) + " is a point; only poses can be fixed");
    }
    (found->second.kind == VertexKind::kNode ? graph_.plane.fixed
                                             : graph_.space.fixed)[found->second.index] = true;
  }
  return {};
}

StatusOr<G2oGraph> Reader::Finish() && {
  const bool place_nodes = !nodes_given_;
  const bool place_points = !points_given_;
  if (!points_given_) {
    SeparateLandmarks();
  }
  MakeVertices();
  if (graph_.in_space() && !(graph_.node_ids.empty() && graph_.point_ids.empty())) {
    return InvalidArgumentError("the graph has records of the plane and of space, must be of one");
  }
  for (const Edge& edge : edges_) {
    LOCI_RETURN_IF_ERROR(AddEdge(edge));
  }
  for (const Record& fix : fixes_) {
    LOCI_RETURN_IF_ERROR(ApplyFix(fix));
  }
  if (place_nodes && graph_.in_space()) {
    PlaceByTree(BreadthFirstTree(graph_.space), graph_.space);
  } else if (place_nodes) {
    PlaceByTree(BreadthFirstTree(graph_.plane), graph_.plane);
  } else if (place_points) {
    PlacePoints(graph_.plane);
  }
  return std::move(graph_);
}

class Writer {
 public:
  Writer& Word(std::string_view word) {
    text_ += word;
    return *this;
  }
  template <typename Number>
  Writer& Field(Number number) {
    std::array<char, 32> buffer{};
    const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number);
    text_ += ' ';
    text_.append(buffer.data(), end);
    return *this;
  }
  Writer& Field(const Pose2& pose) { return Field(pose.x).Field(pose.y).Field(pose.theta); }
  Writer& Field(const Pose3& pose) {
    return Vector(pose.translation).Vector(pose.rotation.coeffs());  // x, y, z, w
  }
  template <typename Derived>
  Writer& Vector(const Eigen::MatrixBase<Derived>& vector) {
    for (Eigen::Index i = 0; i < vector.size(); ++i) {
      Field(vector(i));
    }
    return *this;
  }
  template <int kSize>
  Writer& Upper(const Eigen::Matrix<double, kSize, kSize>& matrix) {
    for (int row = 0; row < kSize; ++row) {
      for (int column = row; column < kSize; ++column) {
        Field(matrix(row, column));
      }
    }
    return *this;
  }
  void EndLine() { text_ += '\n'; }
  std::string TakeText() { return std::move(text_); }

 private:
  std::string text_;
};

void PrintFixed(const std::vector<bool>& fixed,
                const std::vector<std::int64_t>& ids,
                Writer& writer) {
  for (std::size_t i = 0; i < fixed.size(); ++i) {
    if (fixed[i]) {
      writer.Word("FIX").Field(ids[i]).EndLine();
    }
  }
}

void PrintPlane(const G2oGraph& graph, Writer& writer) {
  const PoseGraph& plane = graph.plane;
  for (std::size_t i = 0; i < plane.map_from_node.size(); ++i) {
    writer.Word("VERTEX_SE2").Field(graph.node_ids[i]).Field(plane.map_from_node[i]).EndLine();
  }
  for (std::size_t i = 0; i < plane.points_in_map.size(); ++i) {
    writer.Word("VERTEX_XY").Field(graph.point_ids[i]).Vector(plane.points_in_map[i]).EndLine();
  }
  PrintFixed(plane.fixed, graph.node_ids, writer);
  for (const GraphConstraint& constraint : plane.constraints) {
    writer.Word("EDGE_SE2").Field(graph.node_ids[constraint.from]);
    writer.Field(graph.node_ids[constraint.to]).Field(constraint.from_from_to);
    writer.Upper(constraint.information).EndLine();
  }
  for (const PointConstraint& constraint : plane.point_constraints) {
    writer.Word("EDGE_SE2_XY").Field(graph.node_ids[constraint.from]);
    writer.Field(graph.point_ids[constraint.point]).Vector(constraint.point_in_from);
    writer.Upper(constraint.information).EndLine();
  }
}

void PrintSpace(const G2oGraph& graph, Writer& writer) {
  const SpaceGraph& space = graph.space;
  for (std::size_t i = 0; i < space.map_from_node.size(); ++i) {
    writer.Word("VERTEX_SE3:QUAT").Field(graph.space_ids[i]);
    writer.Field(space.map_from_node[i]).EndLine();
  }
  PrintFixed(space.fixed, graph.space_ids, writer);
  for (const SpaceConstraint& constraint : space.constraints) {
    writer.Word("EDGE_SE3:QUAT").Field(graph.space_ids[constraint.from]);
    writer.Field(graph.space_ids[constraint.to]).Field(constraint.from_from_to);
    writer.Upper(constraint.information).EndLine();
  }
}

}  // namespace

StatusOr<G2oGraph> ParseG2o(std::string_view text) {
  Reader reader;
  for (std::size_t line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view record = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::vector<std::string_view> words =
        WordsOf(record.substr(0, std::min(record.find('#'), record.size())));
    if (!words.empty()) {
      LOCI_RETURN_IF_ERROR(reader.ReadLine(line, words));
    }
  }
  return std::move(reader).Finish();
}

std::string PrintG2o(const G2oGraph& graph) {
  Writer writer;
  PrintPlane(graph, writer);
  PrintSpace(graph, writer);
  return writer.TakeText();
}

}  // namespace loci
