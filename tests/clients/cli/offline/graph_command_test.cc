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
