// SPDX-License-Identifier: Apache-2.0
#include "clients/log/carmen_message.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>
#include <utility>

namespace loci {
namespace {

constexpr double kDegree = kPi / 180.0;
// Positions beyond this are no odometry of a robot, but damage.
constexpr double kCoordinateMaxM = 1e7;
// Years 1970 to 2200.
constexpr std::int64_t kStampMaxS = 7'258'118'400;

bool IsSpace(char c) {
  return c == ' ' || c == '\t' || c == '\v' || c == '\f' || c == '\r';
}

std::string Quoted(std::string_view text) {
  constexpr std::size_t kShownMax = 40;
  std::string quoted = "\"";
  for (const char c : text.substr(0, kShownMax)) {
    quoted += c >= ' ' && c <= '~' ? c : '?';
  }
  return quoted + (text.size() > kShownMax ? "...\"" : "\"");
}

// The words of a line, one after the other; the first error stays.
class Words {
 public:
  explicit Words(std::string_view line) : rest_(line) {}

  const Status& status() const { return status_; }

  // Empty at the end.
  std::string_view Next() {
    while (!rest_.empty() && IsSpace(rest_.front())) {
      rest_.remove_prefix(1);
    }
    std::size_t length = 0;
    while (length < rest_.size() && !IsSpace(rest_[length])) {
      ++length;
    }
    const std::string_view word = rest_.substr(0, length);
    rest_.remove_prefix(length);
    return word;
  }

  // A number, which may be infinite or not a number.
  double NextNumber(std::string_view field) {
    const std::string_view word = Next();
    double value = 0.0;
    const char* begin = word.data();
    const char* end = begin + word.size();
    if (word.size() > 1 && word.front() == '+') {
      ++begin;
    }
    const auto [stop, error] = std::from_chars(begin, end, value);
    if (word.empty()) {
      Fail(field, "is missing: the line ends too early");
    } else if (error != std::errc() || stop != end) {
      Fail(field, Quoted(word) + ", must be a number");
    }
    return value;
  }

  double NextBounded(std::string_view field, double low, double high) {
    const double value = NextNumber(field);
    if (status_.ok() && !(value >= low && value <= high)) {
      Fail(field,
           std::to_string(value) + ", must be from " + std::to_string(low) + " to " +
               std::to_string(high));
    }
    return value;
  }

  Pose2 NextPose(std::string_view field) {
    Pose2 pose;
    pose.x = NextBounded(field, -kCoordinateMaxM, kCoordinateMaxM);
    pose.y = NextBounded(field, -kCoordinateMaxM, kCoordinateMaxM);
    pose.theta = WrapAngle(NextBounded(field, -kCoordinateMaxM, kCoordinateMaxM));
    return pose;
  }

  std::size_t NextCount(std::string_view field, std::size_t low, std::size_t high) {
    const std::string_view word = Next();
    std::size_t value = 0;
    const char* end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, value);
    if (word.empty()) {
      Fail(field, "is missing: the line ends too early");
    } else if (error != std::errc() || stop != end || value < low || value > high) {
      Fail(field,
           Quoted(word) + ", must be a whole number from " + std::to_string(low) + " to " +
               std::to_string(high));
    }
    return status_.ok() ? value : 0;
  }

  // Seconds in decimals, exactly: a double has no room for nanoseconds since 1970.
  std::int64_t NextStamp(std::string_view field) { return Stamp(field, Next()); }

  // `word` as a stamp.
  std::int64_t Stamp(std::string_view field, std::string_view word) {
    const std::size_t dot = std::min(word.find('.'), word.size());
    const std::string_view whole = word.substr(0, dot);
    std::string_view decimals = word.substr(std::min(dot + 1, word.size()));
    std::int64_t seconds = -1;
    const auto [stop, error] = std::from_chars(whole.data(), whole.data() + whole.size(), seconds);
    const bool whole_ok = error == std::errc() && stop == whole.data() + whole.size();
    const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
    if (word.empty()) {
      Fail(field, "is missing: the line ends too early");
      return 0;
    }
    if (!whole_ok || seconds < 0 || seconds > kStampMaxS ||
        !std::all_of(decimals.begin(), decimals.end(), is_digit)) {
      Fail(field, Quoted(word) + ", must be seconds from 0 to " + std::to_string(kStampMaxS));
      return 0;
    }
    std::int64_t nanoseconds = 0;
    for (std::size_t i = 0; i < 9; ++i) {
      nanoseconds = nanoseconds * 10 + (i < decimals.size() ? decimals[i] - '0' : 0);
    }
    return seconds * 1'000'000'000 + nanoseconds;
  }

  void Fail(std::string_view field, const std::string& problem) {
    if (status_.ok()) {
      status_ = InvalidArgumentError(std::string(field) + ": " + problem);
    }
  }

 private:
  std::string_view rest_;
  Status status_;
};

void ReadRanges(Words& words, std::size_t count, std::vector<double>& ranges_m) {
  ranges_m.reserve(count);
  for (std::size_t i = 0; i < count && words.status().ok(); ++i) {
    ranges_m.push_back(words.NextNumber("range"));
  }
}

StatusOr<CarmenMessage> ParseFlaser(Words words) {
  CarmenLaser laser;
  laser.kind = CarmenLaser::Kind::kFlaser;
  const std::size_t count = words.NextCount("FLASER beam count", 1, kBeamCountMax);
  ReadRanges(words, count, laser.ranges_m);
  laser.world_from_laser = words.NextPose("FLASER laser pose");
  laser.odom_from_robot = words.NextPose("FLASER odometry pose");
  laser.stamp_ns = words.NextStamp("FLASER ipc_stamp");
  if (words.Next().empty() || words.Next().empty()) {
    words.Fail("FLASER host and logger stamp", "are missing: the line ends too early");
  }
  LOCI_RETURN_IF_ERROR(words.status());
  const BeamGeometry geometry = FlaserGeometry(count);
  laser.angle_min_rad = geometry.angle_min_rad;
  laser.angle_step_rad = geometry.angle_step_rad;
  return CarmenMessage(std::move(laser));
}

// The scanner's own words for its geometry. The step is `resolution` where that makes sense; some
// drivers leave it 0 or write nonsense, then it is the field of view's share.
double RobotLaserStep(double fov_rad, double resolution_rad, std::size_t count) {
  const double steps = static_cast<double>(count > 1 ? count - 1 : 1);
  const double turn = 2.0 * kPi + 0.1;
  if (resolution_rad > 1e-6 && resolution_rad * steps <= turn) {
    return resolution_rad;
  }
  return fov_rad > 1e-6 && fov_rad <= turn ? fov_rad / steps : FlaserGeometry(count).angle_step_rad;
}

StatusOr<CarmenMessage> ParseRobotLaser(Words words) {
  CarmenLaser laser;
  laser.kind = CarmenLaser::Kind::kRobotLaser;
  words.NextNumber("ROBOTLASER1 laser type");
  laser.angle_min_rad = words.NextBounded("ROBOTLASER1 start angle", -7.0, 7.0);
  const double fov_rad = words.NextNumber("ROBOTLASER1 field of view");
  const double resolution_rad = words.NextNumber("ROBOTLASER1 resolution");
  laser.range_max_m = words.NextNumber("ROBOTLASER1 maximum range");
  words.NextNumber("ROBOTLASER1 accuracy");
  words.NextNumber("ROBOTLASER1 remission mode");
  const std::size_t count = words.NextCount("ROBOTLASER1 beam count", 1, kBeamCountMax);
  ReadRanges(words, count, laser.ranges_m);
  const std::size_t remissions = words.NextCount("ROBOTLASER1 remissions", 0, kBeamCountMax);
  for (std::size_t i = 0; i < remissions && words.status().ok(); ++i) {
    words.NextNumber("remission");
  }
  laser.world_from_laser = words.NextPose("ROBOTLASER1 laser pose");
  laser.odom_from_robot = words.NextPose("ROBOTLASER1 robot pose");
  // Writers differ in what follows (velocities, safety distances, turn axis): the last three words
  // are always stamp, host and logger stamp.
  std::vector<std::string_view> rest;
  constexpr std::size_t kRestMax = 16;
  for (std::string_view word = words.Next(); !word.empty() && rest.size() < kRestMax;
       word = words.Next()) {
    rest.push_back(word);
  }
  constexpr std::size_t kVelocities = 2;
  if (rest.size() < kVelocities + 3) {
    words.Fail("ROBOTLASER1 ipc_stamp, host and logger stamp",
               "are missing: the line ends too early");
  } else {
    laser.stamp_ns = words.Stamp("ROBOTLASER1 ipc_stamp", rest[rest.size() - 3]);
  }
  LOCI_RETURN_IF_ERROR(words.status());
  laser.angle_min_rad = WrapAngle(laser.angle_min_rad);
  laser.angle_step_rad = RobotLaserStep(fov_rad, resolution_rad, count);
  if (!(laser.range_max_m > 0.0) || !std::isfinite(laser.range_max_m)) {
    laser.range_max_m = 0.0;
  }
  return CarmenMessage(std::move(laser));
}

StatusOr<CarmenMessage> ParseOdometry(Words words) {
  CarmenOdometry odometry;
  odometry.odom_from_robot = words.NextPose("ODOM pose");
  words.NextNumber("ODOM translational velocity");
  words.NextNumber("ODOM rotational velocity");
  words.NextNumber("ODOM acceleration");
  odometry.stamp_ns = words.NextStamp("ODOM ipc_stamp");
  LOCI_RETURN_IF_ERROR(words.status());
  return CarmenMessage(odometry);
}

bool IsMessageWord(std::string_view word) {
  const auto is_letter = [](char c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); };
  return is_letter(word.front()) && std::all_of(word.begin(), word.end(), [&](char c) {
           return is_letter(c) || (c >= '0' && c <= '9') || c == '_' || c == '-' || c == ':';
         });
}

}  // namespace

BeamGeometry FlaserGeometry(std::size_t beam_count) {
  const double steps = static_cast<double>(beam_count - 1);
  switch (beam_count) {
    case 1:
      return {0.0, kDegree};
    case 541:
    case 1081:
      return {-135.0 * kDegree, 270.0 / steps * kDegree};
    case 682:
    case 683:
    case 726:
    case 769: {
      const double step = 360.0 / 1024.0;
      return {-0.5 * steps * step * kDegree, step * kDegree};
    }
    default: {
      const std::size_t intervals = beam_count % 2 == 0 ? beam_count : beam_count - 1;
      return {-90.0 * kDegree, 180.0 / static_cast<double>(intervals) * kDegree};
    }
  }
}

StatusOr<CarmenMessage> ParseCarmenLine(std::string_view line) {
  Words words(line);
  const std::string_view word = words.Next();
  if (word.empty() || word.front() == '#') {
    return CarmenMessage(CarmenOther());
  }
  if (word == "FLASER") {
    return ParseFlaser(words);
  }
  if (word == "ROBOTLASER1") {
    return ParseRobotLaser(words);
  }
  if (word == "ODOM") {
    return ParseOdometry(words);
  }
  if (word == "PARAM") {
    const std::string_view name = words.Next();
    const std::string_view value = words.Next();
    return CarmenMessage(CarmenParam{std::string(name), std::string(value)});
  }
  if (!IsMessageWord(word)) {
    return InvalidArgumentError("message name: " + Quoted(word) +
                                ", must be letters and digits; is the file damaged?");
  }
  return CarmenMessage(CarmenOther());
}

}  // namespace loci
