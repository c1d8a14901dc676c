// SPDX-License-Identifier: Apache-2.0
// Reading and writing pose graphs as text.
#include "core/graph/g2o_format.h"

#include <string>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

TEST(G2oFormatTest, ReadsBackEveryBitThatItPrints) {
  G2oGraph graph;
  graph.plane = RandomLoopGraph(41, 30);
  AddPoints(42, 5, graph.plane);
  RandomSequence random(43);
  for (GraphConstraint& constraint : graph.plane.constraints) {
    constraint.information = RandomInformation(random);
  }
  for (std::int64_t i = 0; i < 30; ++i) {
    graph.node_ids.push_back(1000 - 7 * i);
  }
  graph.point_ids = {5000, 1, 2, -3, 9000000000};
  const StatusOr<G2oGraph> back = ParseG2o(PrintG2o(graph));
  ASSERT_THAT(back, IsOk());
  EXPECT_EQ(back->node_ids, graph.node_ids);
  EXPECT_EQ(back->point_ids, graph.point_ids);
  EXPECT_EQ(back->plane.map_from_node, graph.plane.map_from_node);
  EXPECT_EQ(back->plane.points_in_map, graph.plane.points_in_map);
  EXPECT_TRUE(back->plane.IsFixed(0));
  EXPECT_FALSE(back->plane.IsFixed(1));
  EXPECT_EQ(Chi2(back->plane), Chi2(graph.plane));
  EXPECT_EQ(PrintG2o(*back), PrintG2o(graph));
}

TEST(G2oFormatTest, ReadsTheSixNumbersOfEachDialectInTheirOrder) {
  const StatusOr<G2oGraph> toro =
      ParseG2o("VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nEDGE2 0 1 1 0 0 11 1 22 33 2 3\n");
  ASSERT_THAT(toro, IsOk());
  Eigen::Matrix3d expected;
  expected << 11, 1, 2, 1, 22, 3, 2, 3, 33;
  EXPECT_EQ(toro->plane.constraints[0].information, expected);

  const StatusOr<G2oGraph> g2o = ParseG2o("EDGE_SE2 0 1 1 0 0 11 1 2 22 3 33\n");
  ASSERT_THAT(g2o, IsOk());
  EXPECT_EQ(g2o->plane.constraints[0].information, expected);

  for (const std::string tag : {"EDGE2", "ODOMETRY"}) {
    const StatusOr<G2oGraph> isam = ParseG2o(tag + " 0 1 1 0 0 2 1 0 3 0 5\n");
    ASSERT_THAT(isam, IsOk());
    expected << 4, 2, 0, 2, 10, 0, 0, 0, 25;
    EXPECT_EQ(isam->plane.constraints[0].information, expected);
  }
}

TEST(G2oFormatTest, PlacesTheVerticesOfAFileThatHasEdgesOnly) {
  const StatusOr<G2oGraph> graph = ParseG2o(
      "# a comment\r\n"
      "EDGE_SE2 7 3 1 0 0 1 0 0 1 0 1\r\n"
      "\n"
      "  EDGE_SE2\t3 9 0 2 0 1 0 0 1 0 1   # another\n"
      "EDGE_SE2_XY 9 20 1 1 1 0 1");
  ASSERT_THAT(graph, IsOk());
  EXPECT_EQ(graph->node_ids, (std::vector<std::int64_t>{3, 7, 9}));
  EXPECT_EQ(graph->point_ids, (std::vector<std::int64_t>{20}));
  EXPECT_EQ(graph->plane.map_from_node[1], (Pose2{-1.0, 0.0, 0.0}));
  EXPECT_EQ(graph->plane.map_from_node[2], (Pose2{0.0, 2.0, 0.0}));
  EXPECT_EQ(graph->plane.points_in_map[0], Eigen::Vector2d(1.0, 3.0));
}

TEST(G2oFormatTest, GivesLandmarksThatAreCountedOnTheirOwnNewIds) {
  const StatusOr<G2oGraph> graph =
      ParseG2o("ODOMETRY 0 1 1 0 0 1 0 0 1 0 1\nLANDMARK 1 1 2 0 1 0 1\nLANDMARK 0 4 2 0 1 0 1\n");
  ASSERT_THAT(graph, IsOk());
  EXPECT_EQ(graph->node_ids, (std::vector<std::int64_t>{0, 1}));
  EXPECT_EQ(graph->point_ids, (std::vector<std::int64_t>{6, 9}));
}

TEST(G2oFormatTest, PassesOverOtherRecordsAndCountsThem) {
  const StatusOr<G2oGraph> graph = ParseG2o(
      "VERTEX_SE2 0 0 0 0\nROBOTLASER1 0 -1.5 x y\nEQUIV 1 2\nROBOTLASER1\nPARAMS_SE2OFFSET 0 0\n");
  ASSERT_THAT(graph, IsOk());
  EXPECT_EQ(graph->skipped,
            (std::map<std::string, std::uint64_t>{
                {"EQUIV", 1}, {"PARAMS_SE2OFFSET", 1}, {"ROBOTLASER1", 2}}));
  ASSERT_THAT(ParseG2o(""), IsOk());
}

TEST(G2oFormatTest, NamesTheLineOfAMalformedRecord) {
  const std::string good = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n";
  const auto expect_refused = [&](const std::string& record, const std::string& why) {
    EXPECT_THAT(ParseG2o(good + record + "\n"),
                IsStatus(StatusCode::kInvalidArgument, "line 3: " + why))
        << record;
  };
  expect_refused("EDGE_SE2 0 1 1 0 0 1 0 0 1 0", "EDGE_SE2: 10 fields, must be 11");
  expect_refused("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1 7", "EDGE_SE2: 12 fields, must be 11");
  expect_refused("EDGE_SE2 0 1 1 0 O 1 0 0 1 0 1", "EDGE_SE2: \"O\" is no finite number");
  expect_refused("EDGE_SE2 0 1 1 0 nan 1 0 0 1 0 1", "EDGE_SE2: \"nan\" is no finite number");
  expect_refused("EDGE_SE2 0 1 1 0 1e999 1 0 0 1 0 1", "EDGE_SE2: \"1e999\"");
  expect_refused("EDGE_SE2 0 1.5 1 0 0 1 0 0 1 0 1", "EDGE_SE2: \"1.5\" is no vertex id");
  expect_refused("EDGE_SE2 1 1 1 0 0 1 0 0 1 0 1", "EDGE_SE2: joins vertex 1 to itself");
  expect_refused("EDGE_SE2 0 2 1 0 0 1 0 0 1 0 1", "EDGE_SE2: vertex 2 has no record");
  expect_refused("EDGE_SE2 0 1 1 0 0 1 0 0 -1 0 1", "EDGE_SE2: information: eigenvalue -1");
  expect_refused("EDGE_SE2_XY 0 1 1 0 1 0 1", "EDGE_SE2_XY: vertex 1 is of another kind");
  expect_refused("VERTEX_SE2 1 0 0 0", "VERTEX_SE2: vertex 1 is there already");
  expect_refused("VERTEX_SE3:QUAT 2 0 0 0 0 0 0 0", "VERTEX_SE3:QUAT: the quaternion");
  expect_refused("FIX 3", "FIX: vertex 3 has no record");
  EXPECT_THAT(ParseG2o(good + "VERTEX_SE3:QUAT 2 0 0 0 0 0 0 1\n"),
              IsStatus(StatusCode::kInvalidArgument, "of the plane and of space"));
  EXPECT_THAT(ParseG2o(good + "VERTEX_XY 2 0 0\nFIX 2\n"), IsStatus(StatusCode::kUnimplemented));
}

TEST(G2oFormatTest, NoBytesMakeItFall) {
  G2oGraph graph;
  graph.plane = RandomLoopGraph(44, 8);
  AddPoints(45, 2, graph.plane);
  graph.node_ids = {0, 1, 2, 3, 4, 5, 6, 7};
  graph.point_ids = {8, 9};
  const std::string text = PrintG2o(graph);
  RandomSequence random(46);
  constexpr std::string_view kBytes = "0123456789.-+eE \n\t#XVS\0\xff";
  for (int trial = 0; trial < 2000; ++trial) {
    std::string broken = text;
    for (int k = 0; k < 3; ++k) {
      broken[random.NextBits() % broken.size()] = kBytes[random.NextBits() % kBytes.size()];
    }
    broken.resize(random.NextBits() % broken.size());
    const StatusOr<G2oGraph> parsed = ParseG2o(broken);
    if (parsed.ok()) {
      EXPECT_THAT(ValidateGraph(parsed->plane), IsOk());
      EXPECT_THAT(ParseG2o(PrintG2o(*parsed)), IsOk());
    } else {
      EXPECT_EQ(parsed.status().code(), StatusCode::kInvalidArgument);
    }
  }
}

}  // namespace
}  // namespace loci
