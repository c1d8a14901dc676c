// SPDX-License-Identifier: Apache-2.0
#include "clients/log/carmen_survey.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <variant>

#include "clients/log/log_scan.h"

namespace loci {
namespace {

constexpr std::uint16_t kNothing = LogScan::kNothingSeen;
constexpr double kSamePlaceM = 0.02;
constexpr double kSameAngleRad = 0.02;
constexpr double kSameFraction = 0.95;
// No robot in a building carries its laser farther from its centre than this.
constexpr double kOffsetMaxM = 3.0;
// Logs print six decimals, some three: less than this is rounding.
constexpr double kRoundingM = 0.002;
constexpr double kRoundingRad = 0.002;

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

bool Near(const Pose2& a, const Pose2& b, double distance_m, double angle_rad) {
  return std::hypot(a.x - b.x, a.y - b.y) <= distance_m &&
         std::abs(WrapAngle(a.theta - b.theta)) <= angle_rad;
}

Pose2 MedianPose(const std::vector<Pose2>& poses) {
  std::vector<double> xs;
  std::vector<double> ys;
  std::vector<double> turns;  // from the first, so that angles near pi do not fall apart
  for (const Pose2& pose : poses) {
    xs.push_back(pose.x);
    ys.push_back(pose.y);
    turns.push_back(WrapAngle(pose.theta - poses.front().theta));
  }
  return {Median(xs), Median(ys), WrapAngle(poses.front().theta + Median(turns))};
}

}  // namespace

std::uint16_t QuantiseRange(double range_m, std::uint16_t nothing_from_mm) {
  constexpr std::uint16_t kFifty = 50'000;
  constexpr std::uint16_t kFiftyOne = 51'000;
  if (!(range_m > 0.0) || !(range_m < 65.535)) {  // also not a number
    return kNothing;
  }
  const long mm = std::lround(range_m * 1000.0);
  const auto quantised = static_cast<std::uint16_t>(std::min<long>(mm, kNothing));
  if (quantised == 0 || quantised >= nothing_from_mm || quantised == kFifty ||
      quantised == kFiftyOne) {
    return kNothing;
  }
  return quantised;
}

CarmenSurvey::CarmenSurvey() : count_by_mm_(std::size_t{kNothing} + 1) {}

void CarmenSurvey::Add(const CarmenMessage& message) {
  if (const auto* laser = std::get_if<CarmenLaser>(&message)) {
    AddLaser(*laser);
  } else if (const auto* param = std::get_if<CarmenParam>(&message)) {
    AddParam(*param);
  }
}

void CarmenSurvey::AddLaser(const CarmenLaser& laser) {
  first_stamp_ns_ = scan_count_ == 0 ? laser.stamp_ns : std::min(first_stamp_ns_, laser.stamp_ns);
  last_stamp_ns_ = scan_count_ == 0 ? laser.stamp_ns : std::max(last_stamp_ns_, laser.stamp_ns);
  ++scan_count_;
  for (const double range_m : laser.ranges_m) {
    ++count_by_mm_[QuantiseRange(range_m, kNothing)];
  }
  Relations& relations = relations_[static_cast<std::size_t>(laser.kind)];
  if (relations.seen++ % relations.stride != 0) {
    return;
  }
  std::vector<Pose2>& kept = relations.robot_from_laser;
  kept.push_back(Inverse(laser.odom_from_robot) * laser.world_from_laser);
  if (kept.size() == kRelationsMax) {
    for (std::size_t i = 0; 2 * i < kept.size(); ++i) {
      kept[i] = kept[2 * i];
    }
    kept.resize(kRelationsMax / 2);
    relations.stride *= 2;
  }
}

void CarmenSurvey::AddParam(const CarmenParam& param) {
  double* target = nullptr;
  if (param.name == "robot_frontlaser_offset") {
    target = &param_offset_.x;
  } else if (param.name == "robot_frontlaser_side_offset") {
    target = &param_offset_.y;
  } else if (param.name == "robot_frontlaser_angular_offset") {
    target = &param_offset_.theta;
  }
  double value = 0.0;
  const char* end = param.value.data() + param.value.size();
  if (target != nullptr && std::from_chars(param.value.data(), end, value).ec == std::errc() &&
      std::abs(value) <= kOffsetMaxM + kPi) {
    *target = value;
  }
}

Pose2 CarmenSurvey::ComputeRobotFromLaser(CarmenLaser::Kind kind) const {
  const std::vector<Pose2>& kept = relations_[static_cast<std::size_t>(kind)].robot_from_laser;
  const Pose2 by_param = {param_offset_.x, param_offset_.y, WrapAngle(param_offset_.theta)};
  if (kept.empty()) {
    return by_param;
  }
  const Pose2 median = MedianPose(kept);
  const auto same = std::count_if(kept.begin(), kept.end(), [&](const Pose2& pose) {
    return Near(pose, median, kSamePlaceM, kSameAngleRad);
  });
  const bool constant =
      static_cast<double>(same) >= kSameFraction * static_cast<double>(kept.size());
  const bool told_apart = !Near(median, Pose2(), kRoundingM, kRoundingRad);
  const bool on_robot = std::hypot(median.x, median.y) <= kOffsetMaxM;
  return constant && told_apart && on_robot ? median : by_param;
}

std::uint16_t CarmenSurvey::ComputeNothingSeenFromMm() const {
  constexpr int kCodesMax = 4;
  constexpr std::uint64_t kCountMin = 50;
  constexpr std::uint64_t kDominance = 10;
  std::size_t nothing_from = kNothing;
  for (int code = 0; code < kCodesMax; ++code) {
    std::size_t largest = nothing_from - 1;
    while (largest > 0 && count_by_mm_[largest] == 0) {
      --largest;
    }
    const std::size_t below_begin = largest - largest / 10;
    const std::size_t below_end = largest - largest / 500;
    std::uint64_t below_max = 1;
    for (std::size_t mm = below_begin; mm < below_end; ++mm) {
      below_max = std::max(below_max, count_by_mm_[mm]);
    }
    if (largest == 0 || count_by_mm_[largest] < std::max(kCountMin, kDominance * below_max)) {
      break;
    }
    nothing_from = largest;
  }
  return static_cast<std::uint16_t>(nothing_from);
}

}  // namespace loci
