// SPDX-License-Identifier: Apache-2.0
// How far long work has come, on a terminal.
#pragma once

#include <chrono>
#include <cstddef>
#include <iosfwd>
#include <string>

namespace loci::cli {

// One line that is written over and over, at most 10 times a second. Silent if nobody watches.
class ProgressBar {
 public:
  ProgressBar(std::ostream& out, bool shown, std::string label);
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar();  // takes the line away

  // `done` of `total`; a total of 0 is not known. `note` follows the figures.
  void Show(std::size_t done, std::size_t total, const std::string& note);
  // Writes a line above the bar, shown or not.
  void Print(const std::string& line);

 private:
  void Clear();

  std::ostream& out_;
  bool shown_;
  bool drawn_ = false;
  std::string label_;
  std::chrono::steady_clock::time_point last_;
};

}  // namespace loci::cli
