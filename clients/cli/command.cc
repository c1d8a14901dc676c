// SPDX-License-Identifier: Apache-2.0
#include "clients/cli/command.h"

#include <array>
#include <charconv>
#include <cmath>

namespace loci::cli {

StatusOr<Pose2> ParsePose(const std::string& text) {
  const Status problem = InvalidArgumentError(
      "\"" + text + "\": must be X,Y,THETA in metres and radians, for example 1.5,-2,0.1");
  std::array<double, 3> numbers = {};
  const char* begin = text.data();
  const char* const end = begin + text.size();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto [stop, error] = std::from_chars(begin, end, numbers[i]);
    const bool last = i + 1 == numbers.size();
    if (error != std::errc() || !std::isfinite(numbers[i]) ||
        (last ? stop != end : stop == end || *stop != ',')) {
      return problem;
    }
    begin = last ? stop : stop + 1;
  }
  return Pose2{numbers[0], numbers[1], WrapAngle(numbers[2])};
}

std::string CheckPose(const std::string& text) {
  return ParsePose(text).status().message();  // empty for OK
}

}  // namespace loci::cli
