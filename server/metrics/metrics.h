// SPDX-License-Identifier: Apache-2.0
// Counters, gauges and histograms of the running server, and their Prometheus text.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/base/mutex.h"

namespace loci {

// Label names and values, such as {{"map", "hall"}}. Names are [a-z_]+; values may be any text.
using MetricLabels = std::vector<std::pair<std::string, std::string>>;

// A number that only grows. Any thread.
class Counter {
 public:
  void Add(std::uint64_t count = 1) { value_.fetch_add(count, std::memory_order_relaxed); }
  std::uint64_t value() const { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> value_ = 0;
};

// A number that goes up and down. Any thread.
class Gauge {
 public:
  void Set(double value) { value_.store(value, std::memory_order_relaxed); }
  void Add(double difference) { value_.fetch_add(difference, std::memory_order_relaxed); }
  double value() const { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<double> value_ = 0.0;
};

// How often a quantity fell below each of some bounds. Any thread.
class Histogram {
 public:
  // Precondition: `upper_bounds` grow.
  explicit Histogram(std::vector<double> upper_bounds);

  void Observe(double value);

  const std::vector<double>& upper_bounds() const { return upper_bounds_; }
  // One more than there are bounds: the last counts what lies above all of them.
  std::vector<std::uint64_t> Counts() const;
  double sum() const { return sum_.load(std::memory_order_relaxed); }

 private:
  std::vector<double> upper_bounds_;
  std::unique_ptr<std::atomic<std::uint64_t>[]> counts_;
  std::atomic<double> sum_ = 0.0;
};

// From 0.1 ms to 10 s, three to a decade: for calls, renders and commits.
std::vector<double> LatencyBoundsS();

// Collects samples by metric, as the text format wants them: all of one name together.
class MetricsText {
 public:
  void AddCounter(const std::string& name,
                  const std::string& help,
                  const MetricLabels& labels,
                  double value);
  void AddGauge(const std::string& name,
                const std::string& help,
                const MetricLabels& labels,
                double value);
  void AddHistogram(const std::string& name,
                    const std::string& help,
                    const MetricLabels& labels,
                    const Histogram& histogram);

  // Prometheus text format 0.0.4, metrics in order of name.
  std::string Text() const;

 private:
  struct Family {
    std::string type;
    std::string help;
    std::string samples;
  };
  Family& FamilyOf(const std::string& name, const std::string& help, const char* type);

  std::map<std::string, Family> families_;
};

// Owns the metrics of one server. Any thread. What is added lives as long as the registry; asking
// for the same name and labels again gives the same metric.
class MetricRegistry {
 public:
  using Collector = std::function<void(MetricsText&)>;

  MetricRegistry() = default;
  MetricRegistry(const MetricRegistry&) = delete;
  MetricRegistry& operator=(const MetricRegistry&) = delete;

  // By convention a counter's name ends in `_total` and a unit stands in the name: `_seconds`,
  // `_bytes`. Precondition: a name has one type.
  Counter& AddCounter(const std::string& name,
                      const std::string& help,
                      const MetricLabels& labels = {}) LOCI_EXCLUDES(mutex_);
  Gauge& AddGauge(const std::string& name, const std::string& help, const MetricLabels& labels = {})
      LOCI_EXCLUDES(mutex_);
  Histogram& AddHistogram(const std::string& name,
                          const std::string& help,
                          std::vector<double> upper_bounds,
                          const MetricLabels& labels = {}) LOCI_EXCLUDES(mutex_);

  // For numbers that live elsewhere, such as those of each map: asked at every scrape, by the
  // thread that scrapes. It must not add metrics to this registry.
  void AddCollector(Collector collector) LOCI_EXCLUDES(mutex_);

  std::string Text() const LOCI_EXCLUDES(mutex_);

 private:
  template <typename Metric>
  struct Named {
    std::string name;
    std::string help;
    MetricLabels labels;
    std::unique_ptr<Metric> metric;
  };
  template <typename Metric, typename... Arguments>
  Metric& FindOrAdd(std::vector<Named<Metric>>& all,
                    const std::string& name,
                    const std::string& help,
                    const MetricLabels& labels,
                    Arguments&&... arguments) LOCI_REQUIRES(mutex_);

  mutable Mutex mutex_;
  std::vector<Named<Counter>> counters_ LOCI_GUARDED_BY(mutex_);
  std::vector<Named<Gauge>> gauges_ LOCI_GUARDED_BY(mutex_);
  std::vector<Named<Histogram>> histograms_ LOCI_GUARDED_BY(mutex_);
  std::vector<Collector> collectors_ LOCI_GUARDED_BY(mutex_);
};

// Memory, open files and processor time of this process, by Prometheus' usual names.
void CollectProcessMetrics(MetricsText& text);

}  // namespace loci
