// SPDX-License-Identifier: Apache-2.0
// Measuring two ways of doing the same in one run.
#pragma once

#include <algorithm>
#include <ctime>
#include <string_view>
#include <vector>

namespace loci {

// CPU time of this process, in seconds.
inline double CpuSeconds() {
  timespec now = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct InterleavedTimes {
  double ours_s = 0.0;  // medians over the rounds
  double theirs_s = 0.0;
  double ratio = 0.0;  // median of theirs / ours, round by round
};

inline double MedianOf(std::vector<double> values) {
  std::nth_element(values.begin(),
                   values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

// Runs `ours` and `theirs` in turn, `rounds` times, so that a slower spell of the machine meets
// both.
template <typename Ours, typename Theirs>
InterleavedTimes MeasureInterleaved(int rounds, Ours ours, Theirs theirs) {
  std::vector<double> ours_s;
  std::vector<double> theirs_s;
  std::vector<double> ratios;
  for (int round = 0; round < rounds; ++round) {
    const double begin = CpuSeconds();
    ours();
    const double middle = CpuSeconds();
    theirs();
    const double end = CpuSeconds();
    ours_s.push_back(middle - begin);
    theirs_s.push_back(end - middle);
    ratios.push_back((end - middle) / (middle - begin));
  }
  return {MedianOf(ours_s), MedianOf(theirs_s), MedianOf(ratios)};
}

// Whether the program was asked for a short run that only shows that it works.
inline bool IsTiny(int argc, char** argv) {
  return std::any_of(
      argv + 1, argv + argc, [](const char* word) { return std::string_view(word) == "--tiny"; });
}

}  // namespace loci
