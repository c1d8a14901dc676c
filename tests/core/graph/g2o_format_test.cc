// SPDX-License-Identifier: Apache-2.0
// Reading and writing pose graphs as text.
#include "core/graph/g2o_format.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/graph/space_problem.h"
#include "core/graph/sparse_optimizer.h"
#include "tests/core/graph/random_graph.h"
#include "tests/core/graph/random_space_graph.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

// Every kind of record that there is in the plane.
G2oGraph PlaneGraph(std::uint32_t node_count, std::size_t point_count) {
  G2oGraph graph;
  graph.plane = RandomLoopGraph(41, node_count);
  AddPoints(42, point_count, graph.plane);
  AddPriors(47, graph.plane);
  graph.plane.fixed_points = {false, true};
  for (std::int64_t i = 0; i < node_count; ++i) {
    graph.node_ids.push_back(1000 - 7 * i);
  }
  for (std::size_t i = 0; i < point_count; ++i) {
    graph.point_ids.push_back(2000 + static_cast<std::int64_t>(i));
  }
  return graph;
}

// And in space.
G2oGraph SpaceGraphWithAll(std::uint32_t node_count, std::uint32_t point_count) {
  G2oGraph graph;
  graph.space = RandomSpaceGraph(48, node_count);
  AddPoints(49, point_count, graph.space);
  AddPriors(50, graph.space);
  graph.space.fixed = {false, true};
  graph.space.fixed_points = {true};
  for (std::int64_t i = 0; i < node_count; ++i) {
    graph.space_ids.push_back(3 * i);
  }
  for (std::int64_t i = 0; i < point_count; ++i) {
    graph.space_point_ids.push_back(3 * i + 1);
  }
  return graph;
}

TEST(G2oFormatTest, ReadsBackEveryBitThatItPrints) {
  G2oGraph graph = PlaneGraph(30, 5);
  RandomSequence random(43);
  for (GraphConstraint& constraint : graph.plane.constraints) {
    constraint.information = RandomInformation(random);
  }
  graph.point_ids = {5000, 2, 3, -3, 9000000000};
  const StatusOr<G2oGraph> back = ParseG2o(*PrintG2o(graph));
  ASSERT_THAT(back, IsOk());
  EXPECT_EQ(back->node_ids, graph.node_ids);
  EXPECT_EQ(back->point_ids, graph.point_ids);
  EXPECT_EQ(back->plane.map_from_node, graph.plane.map_from_node);
  EXPECT_EQ(back->plane.points_in_map, graph.plane.points_in_map);
  EXPECT_TRUE(back->plane.IsFixed(0));
  EXPECT_FALSE(back->plane.IsFixed(1));
  EXPECT_FALSE(back->plane.IsPointFixed(0));
  EXPECT_TRUE(back->plane.IsPointFixed(1));
  EXPECT_EQ(back->plane.pose_priors.size(), 3U);
  EXPECT_EQ(back->plane.position_priors.size(), 10U);
  EXPECT_EQ(Chi2(back->plane), Chi2(graph.plane));
  EXPECT_EQ(*PrintG2o(*back), *PrintG2o(graph));
}

TEST(G2oFormatTest, ReadsBackAGraphInSpaceUpToTheNormOfQuaternions) {
  const G2oGraph graph = SpaceGraphWithAll(20, 4);
  const std::string text = *PrintG2o(graph);
  const StatusOr<G2oGraph> back = ParseG2o(text);
  ASSERT_THAT(back, IsOk());
  EXPECT_EQ(back->space_ids, graph.space_ids);
  EXPECT_EQ(back->space_point_ids, graph.space_point_ids);
  EXPECT_EQ(back->space.points_in_map, graph.space.points_in_map);
  EXPECT_TRUE(back->space.IsFixed(1));
  EXPECT_TRUE(back->space.IsPointFixed(0));
  EXPECT_FALSE(back->space.IsPointFixed(1));
  EXPECT_EQ(back->space.pose_priors.size(), 4U);
  EXPECT_EQ(back->space.position_priors.size(), 7U);
  const double chi2 = Chi2(graph.space);
  EXPECT_NEAR(Chi2(back->space), chi2, 1e-12 * chi2);
}

TEST(G2oFormatTest, ReadsPriorsInThePlane) {
  const StatusOr<G2oGraph> graph = ParseG2o(
      "EDGE_PRIOR_SE2 4 1 2 0.5 11 1 2 22 3 33\n"
      "EDGE_SE2_PRIOR 4 5 6 0.25 1 0 0 1 0 1\n"
      "EDGE_PRIOR_SE2_XY 4 7 8 44 4 55\n"
      "VERTEX_SE2 4 0 0 0\n");
  ASSERT_THAT(graph, IsOk());
  ASSERT_EQ(graph->plane.pose_priors.size(), 2U);
  EXPECT_EQ(graph->plane.pose_priors[0].map_from_node, (Pose2{1.0, 2.0, 0.5}));
  Eigen::Matrix3d expected;
  expected << 11, 1, 2, 1, 22, 3, 2, 3, 33;
  EXPECT_EQ(graph->plane.pose_priors[0].information, expected);
  EXPECT_EQ(graph->plane.pose_priors[1].map_from_node, (Pose2{5.0, 6.0, 0.25}));
  ASSERT_EQ(graph->plane.position_priors.size(), 1U);
  EXPECT_EQ(graph->plane.position_priors[0].node_in_map, Eigen::Vector2d(7.0, 8.0));
  EXPECT_EQ(graph->plane.position_priors[0].information(0, 1), 4.0);
}

TEST(G2oFormatTest, MeasurementsInAFrameOnANodeKeepTheirChi2) {
  // A sensor 1 m ahead of the node, turned left; the node is 1 m up and looks left.
  const std::string text =
      "PARAMS_SE3OFFSET 3 1 0 0 0 0 0.7071067811865476 0.7071067811865476\n"
      "VERTEX_SE3:QUAT 0 0 0 1 0 0 0.7071067811865476 0.7071067811865476\n"
      "VERTEX_TRACKXYZ 1 -5 1 1\n"
      "EDGE_SE3_TRACKXYZ 0 1 3 4 0.5 0 9 0 0 16 0 25\n"
      "EDGE_SE3_PRIOR 0 3 0 1 1.25 0 0 1 0 1 0 0 0 0 0 1 0 0 0 0 4 0 0 0 1 0 0 1 0 1\n"
      "EDGE_SE3_XYZ_PRIOR 0 3 0 0 0 1 0 0 1 0 2\n";
  const StatusOr<G2oGraph> graph = ParseG2o(text);
  ASSERT_THAT(graph, IsOk());
  // The sensor is at (0, 1, 1) and looks back; it sees the point 5 m ahead of it.
  const double point_chi2 = 9.0 * 1.0 + 16.0 * 0.25;
  const double pose_chi2 = 4.0 * 0.0625;
  const double position_chi2 = 2.0;
  EXPECT_NEAR(Chi2(graph->space), point_chi2 + pose_chi2 + position_chi2, 1e-12);
  const StatusOr<G2oGraph> back = ParseG2o(*PrintG2o(*graph));
  ASSERT_THAT(back, IsOk());
  EXPECT_NEAR(Chi2(back->space), Chi2(graph->space), 1e-12);
}

TEST(G2oFormatTest, PlacesPointsOfAFileThatHasEdgesOnlyInSpace) {
  const StatusOr<G2oGraph> graph = ParseG2o(
      "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n"
      "EDGE_SE3:QUAT 0 1 1 2 3 0 0 0 1 " +
      std::string("1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n") +
      "EDGE_SE3_TRACKXYZ 1 7 0 4 5 6 1 0 0 1 0 1\nFIX 7\n");
  ASSERT_THAT(graph, IsOk());
  EXPECT_EQ(graph->space_ids, (std::vector<std::int64_t>{0, 1}));
  EXPECT_EQ(graph->space_point_ids, (std::vector<std::int64_t>{7}));
  EXPECT_EQ(graph->space.points_in_map[0], Eigen::Vector3d(5.0, 7.0, 9.0));
  EXPECT_TRUE(graph->space.IsPointFixed(0));
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
  expect_refused("EDGE_SE2 0 1.5 1 0 0 1 0 0 1 0 1", "EDGE_SE2: \"1.5\" is no id");
  expect_refused("EDGE_SE2 1 1 1 0 0 1 0 0 1 0 1", "EDGE_SE2: joins vertex 1 to itself");
  expect_refused("EDGE_SE2 0 2 1 0 0 1 0 0 1 0 1", "EDGE_SE2: vertex 2 has no record");
  expect_refused("EDGE_SE2 0 1 1 0 0 1 0 0 -1 0 1", "EDGE_SE2: information: eigenvalue -1");
  expect_refused("EDGE_SE2_XY 0 1 1 0 1 0 1", "EDGE_SE2_XY: vertex 1 is of another kind");
  expect_refused("VERTEX_SE2 1 0 0 0", "VERTEX_SE2: vertex 1 is there already");
  expect_refused("FIX 3", "FIX: vertex 3 has no record");
  expect_refused("VERTEX_SE3:QUAT 2 0 0 0 0 0 0 1",
                 "VERTEX_SE3:QUAT: records of the plane and of space in one file; line 1 is "
                 "VERTEX_SE2");
  expect_refused("EDGE_PRIOR_SE2 0 1 2 0 1 0 0 1 0", "EDGE_PRIOR_SE2: 9 fields, must be 10");
  expect_refused("EDGE_PRIOR_SE2 5 1 2 0 1 0 0 1 0 1", "EDGE_PRIOR_SE2: vertex 5 has no record");
  expect_refused("EDGE_PRIOR_SE2_XY 0 1 2 -1 0 1", "EDGE_PRIOR_SE2_XY: information: eigenvalue -1");
  expect_refused("EDGE2 0 1 1 0 0 1 0 inf 1 0 1", "EDGE2: \"inf\" is no finite number");
  expect_refused("ODOMETRY 1 1 1 0 0 1 0 0 1 0 1", "ODOMETRY: joins vertex 1 to itself");
  expect_refused("LANDMARK 0 9 1 0 1 0", "LANDMARK: 6 fields, must be 7");
  expect_refused("VERTEX_XY 1 0 0", "VERTEX_XY: vertex 1 is there already");
  expect_refused("VERTEX2 x 0 0 0", "VERTEX2: \"x\" is no id");
  expect_refused("FIX one", "FIX: \"one\" is no id");
}

TEST(G2oFormatTest, NamesTheLineOfAMalformedRecordInSpace) {
  const std::string good = "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n";
  const std::string six = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1";
  const auto expect_refused = [&](const std::string& record, const std::string& why) {
    EXPECT_THAT(ParseG2o(good + record + "\n"),
                IsStatus(StatusCode::kInvalidArgument, "line 3: " + why))
        << record;
  };
  expect_refused("EDGE_SE3:QUAT 0 0 1 0 0 0 0 0 1" + six,
                 "EDGE_SE3:QUAT: joins vertex 0 to itself");
  expect_refused("EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1" + six, "EDGE_SE3:QUAT: vertex 1 has no record");
  expect_refused("EDGE_SE3_PRIOR 0 0 1 0 0 0 0 0 0" + six, "EDGE_SE3_PRIOR: the quaternion");
  expect_refused("EDGE_SE3_PRIOR 0 4 1 0 0 0 0 0 1" + six, "EDGE_SE3_PRIOR: parameter 4 has no");
  expect_refused("EDGE_SE3_PRIOR 0 0 1 0 0 0 0 0 1 1", "EDGE_SE3_PRIOR: 10 fields, must be 30");
  expect_refused("EDGE_SE3_XYZ_PRIOR 0 0 1 0 0 1 0 0 -1 0 1",
                 "EDGE_SE3_XYZ_PRIOR: information: eigenvalue -1");
  expect_refused("EDGE_SE3_TRACKXYZ 0 0 0 1 0 0 1 0 0 1 0 1",
                 "EDGE_SE3_TRACKXYZ: joins vertex 0 to itself");
  expect_refused("VERTEX_SE3:QUAT 2 0 0 0 0 0 0 0", "VERTEX_SE3:QUAT: the quaternion");
  expect_refused("VERTEX_TRACKXYZ 5 1 0", "VERTEX_TRACKXYZ: 3 fields, must be 4");
  expect_refused("PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1",
                 "PARAMS_SE3OFFSET: parameter 0 is there already");
  expect_refused("VERTEX_SE2 5 0 0 0", "VERTEX_SE2: records of the plane and of space in one file");
}

TEST(G2oFormatTest, AZeroInformationCountsAndIsKept) {
  const StatusOr<G2oGraph> graph =
      ParseG2o("EDGE_SE2 0 1 1 0 0 0 0 0 0 0 0\nEDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n");
  ASSERT_THAT(graph, IsOk());
  EXPECT_EQ(graph->plane.constraints.size(), 2U);
  EXPECT_EQ(CountZeroInformation(graph->plane), 1U);
}

// Replaces three bytes and cuts the end off, again and again.
void ExpectNoBytesMakeItFall(const std::string& text, std::uint64_t seed) {
  RandomSequence random(seed);
  constexpr std::string_view kBytes = "0123456789.-+eE \n\t#XVS\0\xff";
  for (int trial = 0; trial < 1500; ++trial) {
    std::string broken = text;
    for (int k = 0; k < 3; ++k) {
      broken[random.NextBits() % broken.size()] = kBytes[random.NextBits() % kBytes.size()];
    }
    if (trial % 2 == 0) {
      broken.resize(random.NextBits() % broken.size());
    }
    StatusOr<G2oGraph> parsed = ParseG2o(broken);
    if (!parsed.ok()) {
      EXPECT_EQ(parsed.status().code(), StatusCode::kInvalidArgument);
      EXPECT_THAT(parsed.status().message(), testing::StartsWith("line "));
      continue;
    }
    EXPECT_THAT(ValidateGraph(parsed->plane), IsOk());
    EXPECT_THAT(ValidateGraph(parsed->space), IsOk());
    EXPECT_THAT(ParseG2o(*PrintG2o(*parsed)), IsOk());
    // What was read can be optimised, however odd its numbers are.
    const double plane_chi2 = Chi2(parsed->plane);
    const double space_chi2 = Chi2(parsed->space);
    SparseOptions options;
    options.iterations_max = 3;
    EXPECT_FALSE(OptimizeSparse(parsed->plane, options).chi2_after > plane_chi2);
    EXPECT_FALSE(OptimizeSparse(parsed->space, options).chi2_after > space_chi2);
  }
}

TEST(G2oFormatTest, NoBytesMakeItFall) {
  ExpectNoBytesMakeItFall(*PrintG2o(PlaneGraph(8, 2)), 46);
  ExpectNoBytesMakeItFall(*PrintG2o(SpaceGraphWithAll(6, 2)), 47);
}

TEST(G2oFormatTest, NoBytesOfOlderDialectsMakeItFall) {
  ExpectNoBytesMakeItFall(
      "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nVERTEX2 2 2 1 1.5\nEQUIV 0 2\n"
      "EDGE2 0 1 1 0 0 11 1 22 33 2 3\nEDGE2 1 2 1 1 1.5 11 1 22 33 2 3\n"
      "EDGE2 0 2 2 1 1.5 11 1 22 33 2 3\nFIX 1\n",
      48);
  ExpectNoBytesMakeItFall(
      "ODOMETRY 0 1 1 0 0 2 1 0 3 0 5\nLANDMARK 0 5 2 1 7 0 9\nODOMETRY 1 2 1 0 0.5 2 1 0 3 0 5\n"
      "LANDMARK 2 5 0.5 0.5 7 0 9\nEDGE2 0 2 2 0 0.5 2 1 0 3 0 5\n",
      49);
}

}  // namespace
}  // namespace loci
