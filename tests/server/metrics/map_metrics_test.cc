// SPDX-License-Identifier: Apache-2.0
#include "server/metrics/map_metrics.h"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace loci {
namespace {

using ::testing::HasSubstr;

class OneMap final : public SnapshotSource {
 public:
  explicit OneMap(MapStatus status) : status_(std::move(status)) {}

  StatusOr<std::shared_ptr<const Snapshot>> FindSnapshot(const std::string& /*map*/,
                                                         Revision /*revision*/) const override {
    return NotFoundError("not asked for here");
  }
  std::vector<MapStatus> Maps() const override { return {status_}; }
  StatusOr<std::unique_ptr<Subscription>> Subscribe(const std::string& /*map*/,
                                                    RevisionCallback /*callback*/) override {
    return NotFoundError("not asked for here");
  }

 private:
  MapStatus status_;
};

TEST(MapMetricsTest, ClosuresAreGivenByLastLongestAndTotalTimeAndByPlacesMoved) {
  MapStatus status;
  status.map = "hall";
  status.state = MapState::kServing;
  status.closures = {
      .events = 3, .last_ms = 250.0, .max_ms = 500.0, .total_ms = 1000.0, .last_places_moved = 40};
  MetricsText text;
  CollectMapMetrics(OneMap(status), text);
  const std::string written = text.Text();
  EXPECT_THAT(written, HasSubstr("loci_map_last_closure_seconds{map=\"hall\"} 0.25\n"));
  EXPECT_THAT(written, HasSubstr("loci_map_closure_seconds_max{map=\"hall\"} 0.5\n"));
  EXPECT_THAT(written, HasSubstr("loci_map_closure_seconds_total{map=\"hall\"} 1\n"));
  EXPECT_THAT(written, HasSubstr("loci_map_closure_events_total{map=\"hall\"} 3\n"));
  EXPECT_THAT(written, HasSubstr("loci_map_last_closure_places_moved{map=\"hall\"} 40\n"));
}

}  // namespace
}  // namespace loci
