// SPDX-License-Identifier: Apache-2.0
// The relations error of maps of real logs.
//
// The logs are not part of the project: the folder named by LOCI_DATASETS, or ../shared/datasets
// beside the source tree, holds carmen/LOG.clf.bz2 and carmen/LOG.relations. Skipped without.
#include "bench/relations.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <ostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "bench/map_of_log.h"
#include "tests/support/matchers.h"

namespace loci {
namespace {

// What a log must reach with the default settings.
struct Demand {
  std::string log;
  std::string relations;
  double mean_m;
  double mean_deg;
};

void PrintTo(const Demand& demand, std::ostream* out) {
  *out << demand.log;
}

std::filesystem::path CarmenFolder() {
  const char* named = std::getenv("LOCI_DATASETS");
  return std::filesystem::path(named != nullptr ? named : LOCI_DATASETS_BESIDE_SOURCE) / "carmen";
}

class RelationsTest : public testing::TestWithParam<Demand> {};

TEST_P(RelationsTest, TheMapOfARealLogIsAsExactAsPromised) {
  const Demand& demand = GetParam();
  const std::filesystem::path log = CarmenFolder() / (demand.log + ".clf.bz2");
  if (!std::filesystem::exists(log)) {
    GTEST_SKIP() << log << " is missing; LOCI_DATASETS names the folder that has carmen/";
  }
  const std::vector<Relation> relations = ReadRelations(CarmenFolder() / demand.relations);
  ASSERT_GT(relations.size(), 100U);
  const StatusOr<MappedLog> mapped = MapOfLog(log.string());
  ASSERT_THAT(mapped, IsOk());
  const RelationsError error = ErrorOf(PosesOf(*mapped->snapshot), relations);
  RecordProperty("mean_m", std::to_string(error.mean_m));
  RecordProperty("mean_deg", std::to_string(error.mean_deg));
  EXPECT_LE(error.mean_m, demand.mean_m);
  EXPECT_LE(error.mean_deg, demand.mean_deg);
  EXPECT_LE(static_cast<double>(error.unmatched), 0.02 * static_cast<double>(relations.size()));
  EXPECT_EQ(mapped->snapshot->cells_written.closure, 0U);
}

INSTANTIATE_TEST_SUITE_P(
    Logs,
    RelationsTest,
    testing::Values(Demand{"intel", "intel.relations", 0.030, 0.45},
                    Demand{"aces", "aces.relations", 0.045, 0.45},
                    Demand{"mit-csail", "mit-csail.pseudo.relations", 0.060, 1.2}),
    [](const auto& instance) {
      std::string name = instance.param.log;
      std::replace(name.begin(), name.end(), '-', '_');
      return name;
    });

}  // namespace
}  // namespace loci
