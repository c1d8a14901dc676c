// SPDX-License-Identifier: Apache-2.0
// Writer of pose graphs as text.
#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "core/graph/g2o_format.h"

namespace loci {
namespace {

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
  PrintFixed(plane.fixed_points, graph.point_ids, writer);
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
  for (const PosePrior& prior : plane.pose_priors) {
    writer.Word("EDGE_PRIOR_SE2").Field(graph.node_ids[prior.node]).Field(prior.map_from_node);
    writer.Upper(prior.information).EndLine();
  }
  for (const PositionPrior& prior : plane.position_priors) {
    writer.Word("EDGE_PRIOR_SE2_XY").Field(graph.node_ids[prior.node]).Vector(prior.node_in_map);
    writer.Upper(prior.information).EndLine();
  }
}

bool IsSame(const Pose3& a, const Pose3& b) {
  return a.translation == b.translation && a.rotation.coeffs() == b.rotation.coeffs();
}

// The frames on nodes in which priors measure, each once; a node's own frame is the first.
std::vector<Pose3> OffsetsOf(const SpaceGraph& space) {
  std::vector<Pose3> offsets;
  if (!space.point_constraints.empty() || !space.pose_priors.empty() ||
      !space.position_priors.empty()) {
    offsets.push_back({});
  }
  for (const SpacePosePrior& prior : space.pose_priors) {
    if (std::none_of(offsets.begin(), offsets.end(), [&](const Pose3& offset) {
          return IsSame(offset, prior.node_from_sensor);
        })) {
      offsets.push_back(prior.node_from_sensor);
    }
  }
  return offsets;
}

void PrintSpacePriors(const G2oGraph& graph, const std::vector<Pose3>& offsets, Writer& writer) {
  for (const SpacePosePrior& prior : graph.space.pose_priors) {
    const auto offset = std::find_if(offsets.begin(), offsets.end(), [&](const Pose3& known) {
      return IsSame(known, prior.node_from_sensor);
    });
    writer.Word("EDGE_SE3_PRIOR").Field(graph.space_ids[prior.node]);
    writer.Field(offset - offsets.begin()).Field(prior.map_from_sensor);
    writer.Upper(prior.information).EndLine();
  }
  for (const SpacePositionPrior& prior : graph.space.position_priors) {
    writer.Word("EDGE_SE3_XYZ_PRIOR").Field(graph.space_ids[prior.node]).Field(0);
    writer.Vector(prior.node_in_map).Upper(prior.information).EndLine();
  }
}

void PrintSpace(const G2oGraph& graph, Writer& writer) {
  const SpaceGraph& space = graph.space;
  const std::vector<Pose3> offsets = OffsetsOf(space);
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    writer.Word("PARAMS_SE3OFFSET").Field(i).Field(offsets[i]).EndLine();
  }
  for (std::size_t i = 0; i < space.map_from_node.size(); ++i) {
    writer.Word("VERTEX_SE3:QUAT").Field(graph.space_ids[i]);
    writer.Field(space.map_from_node[i]).EndLine();
  }
  for (std::size_t i = 0; i < space.points_in_map.size(); ++i) {
    writer.Word("VERTEX_TRACKXYZ").Field(graph.space_point_ids[i]);
    writer.Vector(space.points_in_map[i]).EndLine();
  }
  PrintFixed(space.fixed, graph.space_ids, writer);
  PrintFixed(space.fixed_points, graph.space_point_ids, writer);
  for (const SpaceConstraint& constraint : space.constraints) {
    writer.Word("EDGE_SE3:QUAT").Field(graph.space_ids[constraint.from]);
    writer.Field(graph.space_ids[constraint.to]).Field(constraint.from_from_to);
    writer.Upper(constraint.information).EndLine();
  }
  for (const SpacePointConstraint& constraint : space.point_constraints) {
    writer.Word("EDGE_SE3_TRACKXYZ").Field(graph.space_ids[constraint.from]);
    writer.Field(graph.space_point_ids[constraint.point]).Field(0);
    writer.Vector(constraint.point_in_from).Upper(constraint.information).EndLine();
  }
  PrintSpacePriors(graph, offsets, writer);
}

}  // namespace

StatusOr<std::string> PrintG2o(const G2oGraph& graph) {
  if (!graph.plane.joint_constraints.empty()) {
    return FailedPreconditionError(
        "joint_constraints[0]: g2o has no record for a constraint between more than two nodes");
  }
  Writer writer;
  PrintPlane(graph, writer);
  PrintSpace(graph, writer);
  return writer.TakeText();
}

}  // namespace loci
