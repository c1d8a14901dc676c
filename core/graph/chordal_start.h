// SPDX-License-Identifier: Apache-2.0
// A start from all constraints at once: rotations by a linear problem, then positions by another.
#pragma once

#include "core/graph/pose_graph.h"
#include "core/graph/space_graph.h"

namespace loci {

// The chordal relaxation (Martinec and Pajdla, CVPR 2007; Carlone, Tron, Daniilidis, Dellaert:
// "Initialization Techniques for 3D SLAM", ICRA 2015, section III-B): rotation matrices that
// minimise the sum of w ||R_to - R_from R_measured||^2 (Frobenius) without having to be rotations,
// which is linear; the nearest rotations to them; and then, with the rotations held, positions of
// nodes and points that minimise chi2, which is linear too. w is the mean information about the
// turn.
//
// Held are fixed nodes, fixed points, and one node of each component. Rotations of nodes that hang
// together by points alone keep their relation, since points say nothing about it here. The graph
// must be valid.
void PlaceByChords(PoseGraph& graph);
void PlaceByChords(SpaceGraph& graph);

}  // namespace loci
