// SPDX-License-Identifier: Apache-2.0
// `loci graph optimize` from words to file.
#include "clients/cli/offline/graph_command.h"

#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cli/command_line.h"
#include "core/graph/g2o_format.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_directory.h"

namespace loci::cli {
namespace {

using testing::HasSubstr;

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
    const std::string key = "\"chi2_after\":";
    const std::string json = out_.str();
    ASSERT_THAT(json, HasSubstr(key));
    const double printed = std::stod(json.substr(json.find(key) + key.size()));
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
  expect_refused(space, {"--start", "swept"}, "--start swept: not for graphs in space");
  expect_refused(space, {"--incremental"}, "--incremental: the file has VERTEX_SE3:QUAT");
}

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
  EXPECT_EQ(Run({"graph"}), ExitCode::kUsage);
}

TEST_F(GraphCommandTest, SaysThatDescentIsNotThereForGraphsInSpace) {
  const std::string in = Write("space.g2o", "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n");
  EXPECT_EQ(Run({"graph", "optimize", in, "--out", Path("o"), "--method", "toro"}),
            ExitCode::kRefused);
  EXPECT_THAT(error_.str(), HasSubstr("UNIMPLEMENTED"));
  EXPECT_EQ(Run({"graph", "optimize", in, "--out", Path("o")}), ExitCode::kDone);
}

}  // namespace
}  // namespace loci::cli
