// SPDX-License-Identifier: Apache-2.0
// Pose graphs as text: g2o's format, and the older ones that public data come in.
//
// One record a line, fields apart by blanks, `#` begins a comment. Known records, information as
// the upper triangle row by row unless something else is said:
//   VERTEX_SE2 id x y theta              VERTEX2 (TORO, old g2o) is the same
//   VERTEX_XY id x y
//   VERTEX_SE3:QUAT id x y z qx qy qz qw
//   VERTEX_TRACKXYZ id x y z
//   EDGE_SE2 from to x y theta  I11 I12 I13 I22 I23 I33
//   EDGE2 from to x y theta  Ixx Ixy Iyy Itt Ixt Iyt          in a file with VERTEX2 (TORO's order)
//   EDGE2, ODOMETRY from to x y theta  R11 R12 R13 R22 R23 R33   elsewhere (iSAM: I = R^T R)
//   EDGE_SE2_XY from point x y  I11 I12 I22
//   LANDMARK from point x y  R11 R12 R22                       (iSAM)
//   EDGE_PRIOR_SE2 node x y theta  I11 .. I33                  EDGE_SE2_PRIOR is the same
//   EDGE_PRIOR_SE2_XY node x y  I11 I12 I22
//   EDGE_SE3:QUAT from to x y z qx qy qz qw  I11 .. I66        (21 numbers)
//   PARAMS_SE3OFFSET parameter x y z qx qy qz qw               a frame on a node
//   EDGE_SE3_TRACKXYZ from point parameter x y z  I11 .. I33   measured in that frame
//   EDGE_SE3_PRIOR node parameter x y z qx qy qz qw  I11 .. I66
//   EDGE_SE3_XYZ_PRIOR node parameter x y z  I11 .. I33        the parameter plays no part
//   FIX id ..                                                  of nodes and points
// Vertices and parameters may come after the edges that name them. A file without any vertex record
// of a kind gets them from its edges; they are placed along the breadth-first tree. iSAM's
// landmarks, whose ids may be those of poses too, get new ids then.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/status.h"
#include "core/graph/pose_graph.h"
#include "core/graph/space_graph.h"

namespace loci {

// Either a graph in the plane or one in space; the other one is empty.
struct G2oGraph {
  PoseGraph plane;
  std::vector<std::int64_t> node_ids;   // of plane.map_from_node, in the file's order
  std::vector<std::int64_t> point_ids;  // of plane.points_in_map
  SpaceGraph space;
  std::vector<std::int64_t> space_ids;        // of space.map_from_node
  std::vector<std::int64_t> space_point_ids;  // of space.points_in_map
  // Records of other tags, which have been passed over, by tag.
  std::map<std::string, std::uint64_t> skipped;

  bool in_space() const { return !space.map_from_node.empty() || !space.points_in_map.empty(); }
};

// Errors, kInvalidArgument, with the line: a known record with a wrong count of numbers or a number
// that is none, an edge from a vertex to itself or to one that is missing or of the wrong kind, a
// parameter that is missing, a vertex or parameter that is there twice, an information that is not
// positive semidefinite, records of the plane and of space in one file.
StatusOr<G2oGraph> ParseG2o(std::string_view text);

// The graph in g2o's present records, every vertex with its pose. What ParseG2o reads back is equal
// to the last bit, up to the sign of quaternions and their normalisation. kFailedPrecondition:
// there is a joint constraint, for which g2o has no record.
StatusOr<std::string> PrintG2o(const G2oGraph& graph);

}  // namespace loci
