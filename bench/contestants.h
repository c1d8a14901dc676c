// SPDX-License-Identifier: Apache-2.0
// Measuring by ratio: contestants take turns in one run, since the machine's speed comes and goes.
#pragma once

#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <time.h>

namespace loci {

// Processor time of this thread.
inline double ThreadSeconds() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct Contestant {
  std::string name;
  std::function<void()> run_once;
  double units_per_run = 1.0;
  std::vector<double> units_per_second;  // filled by RunInterleaved, one per round
};

// Each round gives every contestant at least `seconds_min` of processor time, in turn.
inline void RunInterleaved(std::vector<Contestant>& contestants, int rounds, double seconds_min) {
  for (int round = 0; round < rounds; ++round) {
    for (Contestant& contestant : contestants) {
      const double begin = ThreadSeconds();
      double seconds = 0.0;
      int count = 0;
      do {
        contestant.run_once();
        ++count;
        seconds = ThreadSeconds() - begin;
      } while (seconds < seconds_min);
      contestant.units_per_second.push_back(contestant.units_per_run * count / seconds);
    }
  }
}

// Prints the median rate of each and the ratio of the first to it, with its extremes over the
// rounds.
inline void PrintRatios(const std::vector<Contestant>& contestants, const char* unit) {
  const auto median = [](std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
  };
  const std::vector<double>& ours = contestants.front().units_per_second;
  for (const Contestant& contestant : contestants) {
    std::vector<double> ratios;
    for (std::size_t round = 0; round < ours.size(); ++round) {
      ratios.push_back(ours[round] / contestant.units_per_second[round]);
    }
    std::printf("%-44s %10.0f %s/s   ratio %5.2f (%.2f to %.2f)\n",
                contestant.name.c_str(),
                median(contestant.units_per_second),
                unit,
                median(ratios),
                *std::min_element(ratios.begin(), ratios.end()),
                *std::max_element(ratios.begin(), ratios.end()));
  }
}

}  // namespace loci
