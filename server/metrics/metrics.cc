// SPDX-License-Identifier: Apache-2.0
#include "server/metrics/metrics.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "core/base/check.h"

namespace loci {
namespace {

std::string NumberText(double value) {
  if (std::isnan(value)) {
    return "NaN";
  }
  if (std::isinf(value)) {
    return value > 0.0 ? "+Inf" : "-Inf";
  }
  char buffer[32];
  const std::to_chars_result end = std::to_chars(buffer, buffer + sizeof(buffer), value);
  return std::string(buffer, end.ptr);
}

// A label's value, or a help text, must stay on its line and inside its quotes.
std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\\' || c == '"') {
      escaped += '\\';
      escaped += c;
    } else if (c == '\n') {
      escaped += "\\n";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string SampleText(const std::string& name, const MetricLabels& labels, double value) {
  std::string line = name;
  if (!labels.empty()) {
    char separator = '{';
    for (const auto& [label, text] : labels) {
      line += separator;
      line += label + "=\"" + Escaped(text) + '"';
      separator = ',';
    }
    line += '}';
  }
  return line + ' ' + NumberText(value) + '\n';
}

}  // namespace

Histogram::Histogram(std::vector<double> upper_bounds)
    : upper_bounds_(std::move(upper_bounds)),
      counts_(std::make_unique<std::atomic<std::uint64_t>[]>(upper_bounds_.size() + 1)) {
  LOCI_CHECK(std::is_sorted(upper_bounds_.begin(), upper_bounds_.end()));
}

void Histogram::Observe(double value) {
  const auto bucket = std::lower_bound(upper_bounds_.begin(), upper_bounds_.end(), value);
  counts_[static_cast<std::size_t>(bucket - upper_bounds_.begin())].fetch_add(
      1, std::memory_order_relaxed);
  sum_.fetch_add(value, std::memory_order_relaxed);
}

std::vector<std::uint64_t> Histogram::Counts() const {
  std::vector<std::uint64_t> counts(upper_bounds_.size() + 1);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    counts[i] = counts_[i].load(std::memory_order_relaxed);
  }
  return counts;
}

std::vector<double> LatencyBoundsS() {
  return {1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0};
}

MetricsText::Family& MetricsText::FamilyOf(const std::string& name,
                                           const std::string& help,
                                           const char* type) {
  Family& family = families_[name];
  if (family.type.empty()) {
    family.type = type;
    family.help = help;
  }
  LOCI_CHECK(family.type == type);
  return family;
}

void MetricsText::AddCounter(const std::string& name,
                             const std::string& help,
                             const MetricLabels& labels,
                             double value) {
  FamilyOf(name, help, "counter").samples += SampleText(name, labels, value);
}

void MetricsText::AddGauge(const std::string& name,
                           const std::string& help,
                           const MetricLabels& labels,
                           double value) {
  FamilyOf(name, help, "gauge").samples += SampleText(name, labels, value);
}

void MetricsText::AddHistogram(const std::string& name,
                               const std::string& help,
                               const MetricLabels& labels,
                               const Histogram& histogram) {
  std::string& samples = FamilyOf(name, help, "histogram").samples;
  const std::vector<std::uint64_t> counts = histogram.Counts();
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    below += counts[i];
    MetricLabels with_bound = labels;
    with_bound.emplace_back(
        "le",
        i + 1 < counts.size() ? NumberText(histogram.upper_bounds()[i]) : std::string("+Inf"));
    samples += SampleText(name + "_bucket", with_bound, static_cast<double>(below));
  }
  samples += SampleText(name + "_sum", labels, histogram.sum());
  samples += SampleText(name + "_count", labels, static_cast<double>(below));
}

std::string MetricsText::Text() const {
  std::string text;
  for (const auto& [name, family] : families_) {
    text += "# HELP " + name + ' ' + Escaped(family.help) + '\n';
    text += "# TYPE " + name + ' ' + family.type + '\n';
    text += family.samples;
  }
  return text;
}

template <typename Metric, typename... Arguments>
Metric& MetricRegistry::FindOrAdd(std::vector<Named<Metric>>& all,
                                  const std::string& name,
                                  const std::string& help,
                                  const MetricLabels& labels,
                                  Arguments&&... arguments) {
  const auto found = std::find_if(all.begin(), all.end(), [&](const Named<Metric>& named) {
    return named.name == name && named.labels == labels;
  });
  if (found != all.end()) {
    return *found->metric;
  }
  all.push_back({.name = name,
                 .help = help,
                 .labels = labels,
                 .metric = std::make_unique<Metric>(std::forward<Arguments>(arguments)...)});
  return *all.back().metric;
}

Counter& MetricRegistry::AddCounter(const std::string& name,
                                    const std::string& help,
                                    const MetricLabels& labels) {
  const MutexLock lock(mutex_);
  return FindOrAdd(counters_, name, help, labels);
}

Gauge& MetricRegistry::AddGauge(const std::string& name,
                                const std::string& help,
                                const MetricLabels& labels) {
  const MutexLock lock(mutex_);
  return FindOrAdd(gauges_, name, help, labels);
}

Histogram& MetricRegistry::AddHistogram(const std::string& name,
                                        const std::string& help,
                                        std::vector<double> upper_bounds,
                                        const MetricLabels& labels) {
  const MutexLock lock(mutex_);
  return FindOrAdd(histograms_, name, help, labels, std::move(upper_bounds));
}

void MetricRegistry::AddCollector(Collector collector) {
  const MutexLock lock(mutex_);
  collectors_.push_back(std::move(collector));
}

std::string MetricRegistry::Text() const {
  const MutexLock lock(mutex_);
  MetricsText text;
  for (const auto& [name, help, labels, metric] : counters_) {
    text.AddCounter(name, help, labels, static_cast<double>(metric->value()));
  }
  for (const auto& [name, help, labels, metric] : gauges_) {
    text.AddGauge(name, help, labels, metric->value());
  }
  for (const auto& [name, help, labels, metric] : histograms_) {
    text.AddHistogram(name, help, labels, *metric);
  }
  for (const Collector& collector : collectors_) {
    collector(text);
  }
  return text.Text();
}

}  // namespace loci
