// SPDX-License-Identifier: Apache-2.0
// `loci graph optimize` from words to file.
#include "clients/cli/offline/graph_command.h"

#include <cstddef>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cli/command_line.h"
#include "core/graph/g2o_format.h"
#include "tests/core/graph/random_graph.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_directory.h"

namespace loci::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

// A square with one noisy corner, two of its records not of the graph.
constexpr std::string_view kSquare =
    "VERTEX_SE2 10 0 0 0\nVERTEX_SE2 11 2.1 0 1.6\nVERTEX_SE2 12 2 2.2 3.2\nVERTEX_SE2 13 0 2 4.7\n"
    "EDGE_SE2 10 11 2 0 1.57 100 0 0 100 0 100\nEDGE_SE2 11 12 2.1 0 1.57 100 0 0 100 0 100\n"
    "EDGE_SE2 12 13 2 0 1.57 100 0 0 100 0 100\nEDGE_SE2 13 10 2 0 1.6 100 0 0 100 0 100\n"
    "ROBOTLASER1 1 2 3\nROBOTLASER1 4 5 6\n";

class GraphCommandTest : public testing::Test {
 protected:
  ExitCode Run(const std::vector<std::string>& words) {
    out_.str({});
    error_.str({});
    return RunCommandLine(MakeGraphCommands(), words, out_, error_);
  }
  std::string Path(const std::string& name) const { return (directory_.path() / name).string(); }
  std::string Write(const std::string& name, std::string_view text) const {
    std::ofstream(Path(name)) << text;
    return Path(name);
  }
  std::string Read(const std::string& name) const {
    std::ifstream file(Path(name));
    return {std::istreambuf_iterator<char>(file), {}};
  }

  TemporaryDirectory directory_;
  std::ostringstream out_;
  std::ostringstream error_;
};

double NumberAfter(const std::string& key, const std::string& json) {
  const std::size_t at = json.find(key);
  return at == std::string::npos ? -1.0 : std::stod(json.substr(at + key.size()));
}

TEST_F(GraphCommandTest, WritesEveryVertexAndTheChi2ThatItPrints) {
  const std::string in = Write("in.g2o", kSquare);
  for (const std::string method : {"auto", "toro", "gauss-newton", "levenberg-marquardt"}) {
    ASSERT_EQ(
        Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--method", method, "--json"}),
        ExitCode::kDone)
        << error_.str();
    const StatusOr<G2oGraph> written = ParseG2o(Read("out.g2o"));
    ASSERT_THAT(written, IsOk());
    EXPECT_EQ(written->node_ids, (std::vector<std::int64_t>{10, 11, 12, 13}));
    EXPECT_EQ(written->plane.constraints.size(), 4U);
    const std::string json = out_.str();
    const double printed = NumberAfter("\"chi2_after\":", json);
    EXPECT_NEAR(printed, Chi2(written->plane), 1e-9 * printed);
    EXPECT_LT(printed, 2.0);
    EXPECT_THAT(json, HasSubstr("\"ROBOTLASER1\":2"));
    EXPECT_THAT(json, HasSubstr("\"poses\":4"));
  }
}

TEST_F(GraphCommandTest, CountsWhatTheGraphHas) {
  const std::string in = Write("in.g2o",
                               std::string(kSquare) +
                                   "VERTEX_XY 20 1 1\nEDGE_SE2_XY 11 20 1 1 1 0 1\n"
                                   "EDGE_SE2 10 12 2 2 3.14 0 0 0 0 0 0\nVERTEX_SE2 30 5 5 0\n"
                                   "EDGE_PRIOR_SE2_XY 10 0 0 1 0 1\n");
  ASSERT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--json"}), ExitCode::kDone)
      << error_.str();
  for (const std::string part : {"\"poses\":5",
                                 "\"points\":1",
                                 "\"constraints\":6",
                                 "\"priors\":1",
                                 "\"components\":2",
                                 "\"zero_informations\":1",
                                 "\"dimension\":2",
                                 "\"start\":",
                                 "\"attempts\":[{",
                                 "\"read\":",
                                 "\"solve\":",
                                 "\"chi2_before\":",
                                 "\"chi2_start\":"}) {
    EXPECT_THAT(out_.str(), HasSubstr(part));
  }
  ASSERT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o")}), ExitCode::kDone);
  EXPECT_THAT(out_.str(),
              HasSubstr("5 poses, 1 points, 6 constraints, 1 priors, 2 components, 1 of zero "
                        "information; passed over 2 other records (2 ROBOTLASER1)"));
}

TEST_F(GraphCommandTest, BeginsWhereItIsTold) {
  const std::string in = Write("in.g2o", kSquare);
  for (const std::string start :
       {"file", "odometry", "tree", "uncertainty-tree", "chordal", "swept", "prefixes"}) {
    for (const std::string method : {"auto", "toro", "gauss-newton"}) {
      ASSERT_EQ(Run({"graph",
                     "optimize",
                     in,
                     "--out",
                     Path("out.g2o"),
                     "--json",
                     "--method",
                     method,
                     "--start",
                     start}),
                ExitCode::kDone)
          << error_.str();
      EXPECT_THAT(out_.str(), HasSubstr("\"start\":\"" + start + "\""));
      const StatusOr<G2oGraph> written = ParseG2o(Read("out.g2o"));
      ASSERT_THAT(written, IsOk());
      EXPECT_LT(Chi2(written->plane), 2.0);
    }
  }
  EXPECT_EQ(Run({"graph", "optimize", in, "--out", "o", "--start", "anywhere"}), ExitCode::kUsage);
}

TEST_F(GraphCommandTest, GrowsAGraphPoseByPose) {
  const std::string in = Write("in.g2o", kSquare);
  ASSERT_EQ(Run({"graph", "optimize", in, "--out", Path("batch.g2o")}), ExitCode::kDone);
  ASSERT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--incremental", "--json"}),
            ExitCode::kDone)
      << error_.str();
  EXPECT_THAT(out_.str(), HasSubstr("\"steps\":{\"count\":4,\"mean_ms\":"));
  EXPECT_THAT(out_.str(), HasSubstr("\"method\":\"incremental\""));
  const StatusOr<G2oGraph> grown = ParseG2o(Read("out.g2o"));
  const StatusOr<G2oGraph> batch = ParseG2o(Read("batch.g2o"));
  ASSERT_THAT(grown, IsOk());
  ASSERT_THAT(batch, IsOk());
  EXPECT_NEAR(Chi2(grown->plane), Chi2(batch->plane), 1e-6 * Chi2(batch->plane));
  ASSERT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--incremental"}),
            ExitCode::kDone);
  EXPECT_THAT(out_.str(), HasSubstr("a step took "));
}

// Three rounds of a square, node ids from 100, with a last constraint that is wrong.
std::string GraphWithAWrongClosure() {
  G2oGraph graph;
  graph.plane = RandomLoopGraph(71, 60);
  graph.plane.constraints.push_back(
      {5, 37, Pose2{}, graph.plane.constraints.front().information, true});
  for (std::int64_t i = 0; i < 60; ++i) {
    graph.node_ids.push_back(100 + i);
  }
  return *PrintG2o(graph);
}

TEST_F(GraphCommandTest, RefusesAWrongClosureNamesItAndLeavesItOut) {
  const std::string in = Write("in.g2o", GraphWithAWrongClosure());
  for (const std::string robust : {"huber", "cauchy", "geman-mcclure", "dcs", "consistent"}) {
    ASSERT_EQ(
        Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--robust", robust, "--json"}),
        ExitCode::kDone)
        << error_.str();
    const std::string json = out_.str();
    EXPECT_THAT(json, HasSubstr("\"robust\":\"" + robust + "\""));
    EXPECT_THAT(json, HasSubstr("{\"from\":105,\"to\":137,\"chi2\":"));
    const double refused = NumberAfter("\"refused\":", json);
    EXPECT_LE(refused, robust == "consistent" ? 1.0 : 3.0);
    EXPECT_EQ(NumberAfter("\"accepted\":", json) + refused, 41.0);
    EXPECT_EQ(NumberAfter("\"constraints\":", json) + refused, 100.0);
    const StatusOr<G2oGraph> written = ParseG2o(Read("out.g2o"));
    ASSERT_THAT(written, IsOk());
    EXPECT_EQ(static_cast<double>(written->plane.constraints.size()) + refused, 100.0);
    const double printed = NumberAfter("\"chi2_after\":", json);
    EXPECT_NEAR(printed, Chi2(written->plane), 1e-9 * printed);
  }
  ASSERT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--robust", "consistent"}),
            ExitCode::kDone);
  EXPECT_THAT(out_.str(), HasSubstr("40 closures accepted, 1 refused and left out"));
}

TEST_F(GraphCommandTest, BelievesAllConstraintsUnlessToldOtherwise) {
  const std::string in = Write("in.g2o", GraphWithAWrongClosure());
  ASSERT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--json"}), ExitCode::kDone);
  EXPECT_THAT(out_.str(), HasSubstr("\"robust\":\"none\""));
  EXPECT_THAT(out_.str(), HasSubstr("\"constraints\":100,"));
  EXPECT_THAT(out_.str(), Not(HasSubstr("closures")));
}

TEST_F(GraphCommandTest, KernelsBeginWhereTheyAreTold) {
  const std::string in = Write("in.g2o", GraphWithAWrongClosure());
  ASSERT_EQ(
      Run({"graph", "optimize", in, "--out", Path("true.g2o"), "--robust", "consistent", "--json"}),
      ExitCode::kDone);
  EXPECT_THAT(out_.str(), HasSubstr("\"start\":\"without-closures\""));
  // The true map with the wrong closure in it: a start that a kernel keeps.
  StatusOr<G2oGraph> solved = ParseG2o(Read("true.g2o"));
  ASSERT_THAT(solved, IsOk());
  solved->plane.constraints.push_back({5, 37, Pose2{}, 400.0 * Eigen::Matrix3d::Identity(), true});
  const std::string near = Write("near.g2o", *PrintG2o(*solved));
  ASSERT_EQ(Run({"graph",
                 "optimize",
                 near,
                 "--out",
                 Path("out.g2o"),
                 "--robust",
                 "cauchy",
                 "--start",
                 "file",
                 "--json"}),
            ExitCode::kDone);
  EXPECT_THAT(out_.str(), HasSubstr("\"start\":\"file\""));
  EXPECT_THAT(out_.str(), HasSubstr("\"refused\":1,"));
}

TEST_F(GraphCommandTest, SaysWhatDoesNotGoTogether) {
  const auto expect_refused =
      [&](const std::string& in, const std::vector<std::string>& options, const std::string& why) {
        std::vector<std::string> words = {"graph", "optimize", in, "--out", Path("refused.g2o")};
        words.insert(words.end(), options.begin(), options.end());
        EXPECT_EQ(Run(words), ExitCode::kRefused);
        EXPECT_THAT(error_.str(), HasSubstr(why));
        EXPECT_FALSE(std::ifstream(Path("refused.g2o")).good());
      };
  const auto square_with = [&](const std::string& name, const std::string& records) {
    return Write(name, std::string(kSquare) + records);
  };
  const std::string square = square_with("in.g2o", "");
  expect_refused(square, {"--incremental", "--start", "tree"}, "must not come with --start");
  expect_refused(square, {"--incremental", "--method", "toro"}, "must not come with --method toro");
  expect_refused(square,
                 {"--robust", "dcs", "--incremental"},
                 "--robust: is for graphs as a whole, must not come with --incremental");
  expect_refused(square,
                 {"--robust", "dcs", "--method", "toro"},
                 "--robust: is Gauss-Newton, must not come with --method toro");
  expect_refused(
      square, {"--robust", "consistent", "--start", "tree"}, "must not come with --start");
  expect_refused(square_with("fix.g2o", "EDGE_PRIOR_SE2_XY 10 0 0 1 0 1\n"),
                 {"--incremental"},
                 "EDGE_PRIOR_SE2_XY, which only a graph as a whole can have");
  expect_refused(square_with("pose.g2o", "EDGE_PRIOR_SE2 10 0 0 0 1 0 0 1 0 1\n"),
                 {"--incremental"},
                 "EDGE_PRIOR_SE2, which only a graph as a whole can have");
  expect_refused(square_with("point.g2o", "VERTEX_XY 20 1 1\nFIX 20\n"),
                 {"--incremental"},
                 "FIX of a VERTEX_XY, which only a graph as a whole can have");
  expect_refused(
      square_with("loose.g2o", "VERTEX_SE2 14 0 0 0\nEDGE_SE2 13 14 1 0 0 0 0 0 0 0 0\n"),
      {"--incremental"},
      "not tied in all directions");
  const std::string space = Write("space.g2o", "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n");
  expect_refused(space, {"--start", "prefixes"}, "--start prefixes: not for graphs in space");
  expect_refused(space, {"--robust", "consistent"}, "--robust: not for graphs in space");
  expect_refused(space, {"--incremental"}, "--incremental: the file has VERTEX_SE3:QUAT");
}

TEST_F(GraphCommandTest, TakesGraphsThatAreHardlyGraphs) {
  const std::string unit = " 1 0 0 1 0 1\n";
  const std::vector<std::string> plane = {
      "VERTEX_SE2 7 1 2 3\n",
      "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_XY 2 5 5\n",
      // Two components, one of them joined twice and by half turns.
      "EDGE_SE2 0 1 1 0 0" + unit + "EDGE_SE2 5 6 1 0 3.141592653589793" + unit +
          "EDGE_SE2 5 6 1 0 -3.141592653589793" + unit + "EDGE_SE2 6 5 1 0 3.1415926" + unit,
      // A constraint that says nothing beside one that says all.
      "EDGE_SE2 0 1 1 0 0" + unit + "EDGE_SE2 0 1 9 9 1 0 0 0 0 0 0\n"};
  const std::vector<std::string> space = {"VERTEX_SE3:QUAT 7 1 2 3 0 0 0 1\n",
                                          "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 "
                                          "0 1 0 0 0\nVERTEX_TRACKXYZ 2 5 5 5\n"};
  const auto expect_done = [&](const std::string& text, const std::vector<std::string>& options) {
    const std::string in = Write("in.g2o", text);
    std::vector<std::string> words = {"graph", "optimize", in, "--out", Path("out.g2o")};
    words.insert(words.end(), options.begin(), options.end());
    ASSERT_EQ(Run(words), ExitCode::kDone) << text << error_.str();
    const StatusOr<G2oGraph> written = ParseG2o(Read("out.g2o"));
    ASSERT_THAT(written, IsOk());
    EXPECT_LT(Chi2(written->plane) + Chi2(written->space), 1e-6) << text;
  };
  for (const std::string method : {"auto", "gauss-newton", "levenberg-marquardt", "toro"}) {
    for (const std::string& text : plane) {
      expect_done(text, {"--method", method});
    }
    for (const std::string& text : space) {
      expect_done(text, {"--method", method});
    }
  }
  for (const std::string& text : plane) {
    expect_done(text, {"--incremental"});
  }
}

#ifdef LOCI_WITH_CERES
TEST_F(GraphCommandTest, CeresFindsTheSameMinimum) {
  const std::string in = Write("in.g2o", kSquare);
  std::vector<double> chi2;
  for (const std::string method : {"ceres", "gauss-newton"}) {
    ASSERT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--method", method}),
              ExitCode::kDone)
        << error_.str();
    const StatusOr<G2oGraph> written = ParseG2o(Read("out.g2o"));
    ASSERT_THAT(written, IsOk());
    chi2.push_back(Chi2(written->plane));
  }
  EXPECT_NEAR(chi2[0], chi2[1], 1e-6 * chi2[1]);
}
#else
TEST_F(GraphCommandTest, SaysHowToBuildWithCeres) {
  const std::string in = Write("in.g2o", kSquare);
  EXPECT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--method", "ceres"}),
            ExitCode::kRefused);
  EXPECT_THAT(error_.str(), HasSubstr("cmake -DLOCI_WITH_CERES=ON"));
  EXPECT_FALSE(std::ifstream(Path("out.g2o")).good());
}
#endif

TEST_F(GraphCommandTest, NamesFileAndLineOfABadGraph) {
  const std::string in = Write("bad.g2o", "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 zero 0\n");
  EXPECT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o")}), ExitCode::kRefused);
  EXPECT_THAT(error_.str(), HasSubstr("bad.g2o: line 2: VERTEX_SE2: \"zero\" is no finite number"));
  EXPECT_FALSE(std::ifstream(Path("out.g2o")).good());
  EXPECT_EQ(Run({"graph", "optimize", Path("none"), "--out", Path("o")}), ExitCode::kRefused);
  const std::string scans = Write("scans.log", "FLASER 1 2 3\n");
  EXPECT_EQ(Run({"graph", "optimize", scans, "--out", Path("o")}), ExitCode::kRefused);
  EXPECT_THAT(error_.str(), HasSubstr("no pose in it, 1 other records"));
}

TEST_F(GraphCommandTest, UsageErrorsAreTwo) {
  EXPECT_EQ(Run({"graph", "optimize", "in.g2o"}), ExitCode::kUsage);
  EXPECT_EQ(Run({"graph", "optimize", "in.g2o", "--out", "o", "--method", "magic"}),
            ExitCode::kUsage);
  EXPECT_EQ(Run({"graph", "optimize", "in.g2o", "--out", "o", "--robust", "magic"}),
            ExitCode::kUsage);
  EXPECT_EQ(Run({"graph"}), ExitCode::kUsage);
}

TEST_F(GraphCommandTest, DescendsInSpaceToo) {
  constexpr const char* kInformation = " 9 0 0 0 0 0 9 0 0 0 0 9 0 0 0 9 0 0 9 0 9\n";
  // A quarter turn to the left at each corner; the last edge has the square not quite closed.
  const std::string quarter = " 0 0 0.7071067811865476 0.7071067811865476";
  std::string text;
  for (int i = 0; i < 4; ++i) {
    text += "VERTEX_SE3:QUAT " + std::to_string(i) + " 0 0 0 0 0 0 1\n";
  }
  for (const char* ends : {"0 1", "1 2", "2 3"}) {
    text += "EDGE_SE3:QUAT " + std::string(ends) + " 1 0 0" + quarter + kInformation;
  }
  text += "EDGE_SE3:QUAT 3 0 1.2 0 0.1" + quarter + kInformation;
  const std::string in = Write("space.g2o", text);
  ASSERT_EQ(Run({"graph", "optimize", in, "--out", Path("out.g2o"), "--method", "toro"}),
            ExitCode::kDone)
      << error_.str();
  const StatusOr<G2oGraph> given = ParseG2o(text);
  const StatusOr<G2oGraph> written = ParseG2o(Read("out.g2o"));
  ASSERT_THAT(given, IsOk());
  ASSERT_THAT(written, IsOk());
  ASSERT_EQ(written->space.map_from_node.size(), 4U);
  EXPECT_LT(Chi2(written->space), 0.01 * Chi2(given->space));
}

}  // namespace
}  // namespace loci::cli
