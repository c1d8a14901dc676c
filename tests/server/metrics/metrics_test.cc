// SPDX-License-Identifier: Apache-2.0
#include "server/metrics/metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace loci {
namespace {

using ::testing::HasSubstr;

TEST(MetricsTest, SaysOneHelpAndTypeForAllSamplesOfAName) {
  MetricRegistry registry;
  registry.AddCounter("loci_calls_total", "Calls by outcome.", {{"code", "OK"}}).Add(3);
  registry.AddCounter("loci_calls_total", "Calls by outcome.", {{"code", "NOT_FOUND"}}).Add();
  EXPECT_EQ(registry.Text(),
            "# HELP loci_calls_total Calls by outcome.\n"
            "# TYPE loci_calls_total counter\n"
            "loci_calls_total{code=\"OK\"} 3\n"
            "loci_calls_total{code=\"NOT_FOUND\"} 1\n");
}

TEST(MetricsTest, GivesTheSameMetricForTheSameNameAndLabels) {
  MetricRegistry registry;
  Counter& first = registry.AddCounter("a_total", "", {{"map", "hall"}});
  EXPECT_EQ(&first, &registry.AddCounter("a_total", "", {{"map", "hall"}}));
  EXPECT_NE(&first, &registry.AddCounter("a_total", "", {{"map", "yard"}}));
}

TEST(MetricsTest, HistogramBucketsAreCumulativeAndEndWithAllObservations) {
  MetricRegistry registry;
  Histogram& seconds = registry.AddHistogram("t_seconds", "Time.", {0.5, 1.0});
  seconds.Observe(0.25);
  seconds.Observe(1.0);  // a bound belongs to its bucket
  seconds.Observe(7.0);
  EXPECT_EQ(registry.Text(),
            "# HELP t_seconds Time.\n"
            "# TYPE t_seconds histogram\n"
            "t_seconds_bucket{le=\"0.5\"} 1\n"
            "t_seconds_bucket{le=\"1\"} 2\n"
            "t_seconds_bucket{le=\"+Inf\"} 3\n"
            "t_seconds_sum 8.25\n"
            "t_seconds_count 3\n");
}

TEST(MetricsTest, LabelValuesCannotBreakTheirLine) {
  MetricRegistry registry;
  registry.AddGauge("g", "", {{"peer", "a\"b\\c\nd"}}).Set(-0.5);
  EXPECT_THAT(registry.Text(), HasSubstr("g{peer=\"a\\\"b\\\\c\\nd\"} -0.5\n"));
}

TEST(MetricsTest, CollectorsAreAskedAtEveryScrape) {
  MetricRegistry registry;
  double revision = 1.0;
  registry.AddCollector(
      [&](MetricsText& text) { text.AddGauge("loci_revision", "", {}, revision); });
  EXPECT_THAT(registry.Text(), HasSubstr("loci_revision 1\n"));
  revision = 2.0;
  EXPECT_THAT(registry.Text(), HasSubstr("loci_revision 2\n"));
}

TEST(MetricsTest, KnowsMemoryAndOpenFilesOfItsProcess) {
  MetricsText text;
  CollectProcessMetrics(text);
  EXPECT_THAT(text.Text(), ::testing::ContainsRegex("process_resident_memory_bytes [1-9]"));
  EXPECT_THAT(text.Text(), ::testing::ContainsRegex("process_open_fds [1-9]"));
  EXPECT_THAT(text.Text(), HasSubstr("process_cpu_seconds_total "));
}

}  // namespace
}  // namespace loci
