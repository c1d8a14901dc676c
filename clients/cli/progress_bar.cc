// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/progress_bar.h"

#include <algorithm>
#include <ostream>
#include <utility>

namespace loci::cli {
namespace {

constexpr std::size_t kWidth = 30;
constexpr std::chrono::milliseconds kInterval{100};

}  // namespace

ProgressBar::ProgressBar(std::ostream& out, bool shown, std::string label)
    : out_(out), shown_(shown), label_(std::move(label)) {}

ProgressBar::~ProgressBar() {
  Clear();
}

void ProgressBar::Clear() {
  if (drawn_) {
    out_ << "\r\x1b[K" << std::flush;
    drawn_ = false;
  }
}

void ProgressBar::Show(std::size_t done, std::size_t total, const std::string& note) {
  const auto now = std::chrono::steady_clock::now();
  if (!shown_ || (drawn_ && now - last_ < kInterval)) {
    return;
  }
  last_ = now;
  drawn_ = true;
  out_ << "\r\x1b[K" << label_ << ' ';
  if (total > 0) {
    const std::size_t filled = std::min(done, total) * kWidth / total;
    out_ << '[' << std::string(filled, '#') << std::string(kWidth - filled, '.') << "] "
         << std::min(done, total) * 100 / total << " %  ";
  }
  out_ << done;
  if (total > 0) {
    out_ << '/' << total;
  }
  out_ << "  " << note << std::flush;
}

void ProgressBar::Print(const std::string& line) {
  Clear();
  out_ << line << '\n';
}

}  // namespace loci::cli
