// SPDX-License-Identifier: Apache-2.0
// The public graphs by `loci graph optimize`, and a judge of chi2 that shares no code with it.
#include <algorithm>
#include <filesystem>
#include <iterator>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "clients/cli/command_line.h"
#include "clients/cli/offline/graph_command.h"
#include "tests/support/datasets.h"
#include "tests/support/program.h"
#include "tests/support/public_graphs.h"
#include "tests/support/temporary_directory.h"

namespace loci::cli {
namespace {

constexpr const char* kPython = "/usr/bin/python3";

std::filesystem::path Judge() {
  return DatasetsFolder() / "../eval/chi2.py";
}

std::vector<PublicGraph> GraphsNamed(const std::vector<std::string_view>& names) {
  std::vector<PublicGraph> graphs;
  std::copy_if(kPublicGraphs.begin(),
               kPublicGraphs.end(),
               std::back_inserter(graphs),
               [&](const PublicGraph& graph) {
                 return std::find(names.begin(), names.end(), graph.name) != names.end();
               });
  return graphs;
}

// Optimises `file` with `options`, and holds what is printed against the judge; returns
// chi2.
double JudgedChi2(const std::string& file, const std::vector<std::string>& options) {
  const TemporaryDirectory directory;
  const std::string result = (directory.path() / "result.g2o").string();
  std::vector<std::string> words = {"graph", "optimize", file, "--out", result, "--json"};
  words.insert(words.end(), options.begin(), options.end());
  std::ostringstream out;
  std::ostringstream error;
  EXPECT_EQ(RunCommandLine(MakeGraphCommands(), words, out, error), ExitCode::kDone) << error.str();
  const double ours = nlohmann::json::parse(out.str()).at("chi2_after");
  const Ended judged = RunProgram({kPython, Judge().string(), result, "--json"});
  EXPECT_EQ(judged.exit_code, 0) << judged.error;
  const double theirs = nlohmann::json::parse(judged.out).at("chi2");
  EXPECT_NEAR(ours, theirs, 1e-6 * theirs);
  return ours;
}

class GraphJudgeTest : public testing::TestWithParam<PublicGraph> {
 protected:
  void SetUp() override {
    for (const std::filesystem::path& needed : {File(), Judge(), std::filesystem::path(kPython)}) {
      if (!std::filesystem::exists(needed)) {
        GTEST_SKIP() << needed << " is missing: nobody judges `loci graph optimize`";
      }
    }
  }
  static std::filesystem::path File() { return DatasetsFolder() / GetParam().file; }
};

TEST_P(GraphJudgeTest, AutoReachesTheBestKnownChi2) {
  const double chi2 = JudgedChi2(File(), {});
  EXPECT_LT(chi2, 1.001 * GetParam().best_chi2);
  EXPECT_GT(chi2, 0.999 * GetParam().best_chi2);
}

INSTANTIATE_TEST_SUITE_P(All, GraphJudgeTest, testing::ValuesIn(kPublicGraphs), NameOfPublicGraph);

class GrownGraphJudgeTest : public GraphJudgeTest {};

TEST_P(GrownGraphJudgeTest, PoseByPoseItIsTheSameOptimum) {
  const double chi2 = JudgedChi2(File(), {"--incremental"});
  EXPECT_NEAR(chi2, GetParam().best_chi2, 1e-3 * GetParam().best_chi2);
}

// Those in the plane that take a second or two; the last has points.
INSTANTIATE_TEST_SUITE_P(
    Some,
    GrownGraphJudgeTest,
    testing::ValuesIn(GraphsNamed({"intel_g2o", "CSAIL", "MIT", "M3500a", "victoriaPark"})),
    NameOfPublicGraph);

}  // namespace
}  // namespace loci::cli
