// SPDX-License-Identifier: Apache-2.0
#include "clients/log/carmen_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

namespace loci {
namespace {

// Whether the file stops within this line. Without a newline at its end a whole message is
// accepted; what is no whole message was cut.
Status CheckWhole(const LineSource::Line& line) {
  if (line.ended) {
    return {};
  }
  if (line.text.size() >= LineSource::kLineBytesMax) {
    return InvalidArgumentError("longer than " + std::to_string(LineSource::kLineBytesMax) +
                                " bytes, must be a message of at most that; is the file damaged?");
  }
  const bool begins_a_message = !line.text.empty() &&
                                line.text.find(' ') == std::string_view::npos &&
                                (std::string_view("FLASER").starts_with(line.text) ||
                                 std::string_view("ROBOTLASER1").starts_with(line.text) ||
                                 std::string_view("ODOM").starts_with(line.text));
  return begins_a_message ? InvalidArgumentError("the file ends within this line") : Status();
}

StatusOr<CarmenMessage> ParseLine(const LineSource::Line& line) {
  LOCI_RETURN_IF_ERROR(CheckWhole(line));
  StatusOr<CarmenMessage> message = ParseCarmenLine(line.text);
  if (!message.ok() && !line.ended) {
    return InvalidArgumentError(message.status().message() + " (the file ends within this line)");
  }
  return message;
}

}  // namespace

CarmenReader::CarmenReader(std::string path, const CarmenReaderOptions& options, LineSource lines)
    : path_(std::move(path)), options_(options), lines_(std::move(lines)) {}

StatusOr<std::unique_ptr<CarmenReader>> CarmenReader::Open(const std::string& path,
                                                           const CarmenReaderOptions& options) {
  LOCI_ASSIGN_OR_RETURN(std::unique_ptr<ByteSource> survey_bytes, OpenByteSource(path));
  LOCI_ASSIGN_OR_RETURN(std::unique_ptr<ByteSource> bytes, OpenByteSource(path));
  std::unique_ptr<CarmenReader> reader(
      new CarmenReader(path, options, LineSource(std::move(bytes))));
  LineSource survey_lines(std::move(survey_bytes));
  LOCI_RETURN_IF_ERROR(reader->RunSurvey(survey_lines));
  return reader;
}

// Errors in lines are left for Next, unless they are all that there is.
Status CarmenReader::RunSurvey(LineSource& lines) {
  Status first_error;
  while (true) {
    StatusOr<std::optional<LineSource::Line>> line = lines.Next();
    if (line.ok() && !line->has_value()) {
      break;
    }
    StatusOr<CarmenMessage> message =
        line.ok() ? ParseLine(**line) : StatusOr<CarmenMessage>(line.status());
    if (message.ok()) {
      survey_.Add(*message);
    } else if (first_error.ok()) {
      first_error = AtLine(lines.line_number(), message.status());
    }
    if (!line.ok()) {
      break;
    }
  }
  if (survey_.scan_count() == 0) {
    return !first_error.ok() ? first_error
                             : InvalidArgumentError(path_ +
                                                    ": holds no laser scan (FLASER or ROBOTLASER1 "
                                                    "line); is it a log in CARMEN's format?");
  }
  robot_from_flaser_ = survey_.ComputeRobotFromLaser(CarmenLaser::Kind::kFlaser);
  robot_from_robotlaser_ = survey_.ComputeRobotFromLaser(CarmenLaser::Kind::kRobotLaser);
  nothing_from_mm_ = survey_.ComputeNothingSeenFromMm();
  return {};
}

Status CarmenReader::AtLine(std::size_t line, const Status& status) const {
  return Status(status.code(), path_ + ":" + std::to_string(line) + ": " + status.message());
}

StatusOr<std::optional<LogScan>> CarmenReader::Next() {
  LOCI_RETURN_IF_ERROR(status_);
  while (!at_end_) {
    StatusOr<std::optional<LineSource::Line>> line = lines_.Next();
    if (line.ok() && !line->has_value()) {
      break;
    }
    StatusOr<CarmenMessage> message =
        line.ok() ? ParseLine(**line) : StatusOr<CarmenMessage>(line.status());
    at_end_ = !line.ok();
    if (!message.ok() && options_.on_error == CarmenReaderOptions::OnError::kStop) {
      status_ = AtLine(lines_.line_number(), message.status());
      return status_;
    }
    if (!message.ok()) {
      ++skipped_count_;
      continue;
    }
    const auto* laser = std::get_if<CarmenLaser>(&*message);
    if (laser == nullptr) {
      continue;
    }
    if (IsDuplicate(*laser)) {
      ++duplicate_count_;
      continue;
    }
    last_kind_ = laser->kind;
    last_stamp_ns_ = laser->stamp_ns;
    return std::optional<LogScan>(ScanFrom(*laser, lines_.line_number()));
  }
  at_end_ = true;
  return std::optional<LogScan>();
}

bool CarmenReader::IsDuplicate(const CarmenLaser& laser) const {
  return last_kind_.has_value() && *last_kind_ != laser.kind && last_stamp_ns_ == laser.stamp_ns;
}

LogScan CarmenReader::ScanFrom(const CarmenLaser& laser, std::size_t line) const {
  LogScan scan;
  scan.stamp_ns = laser.stamp_ns;
  scan.odom_from_robot = laser.odom_from_robot;
  scan.robot_from_laser =
      laser.kind == CarmenLaser::Kind::kFlaser ? robot_from_flaser_ : robot_from_robotlaser_;
  scan.angle_min_rad = laser.angle_min_rad;
  scan.angle_step_rad = laser.angle_step_rad;
  scan.line = line;
  std::uint16_t nothing_from_mm = nothing_from_mm_;
  if (laser.range_max_m > 0.0 && laser.range_max_m < 65.0) {
    const auto told_mm = static_cast<std::uint16_t>(std::lround(laser.range_max_m * 1000.0));
    nothing_from_mm = std::min(nothing_from_mm, told_mm);
  }
  scan.ranges_mm.reserve(laser.ranges_m.size());
  for (const double range_m : laser.ranges_m) {
    scan.ranges_mm.push_back(QuantiseRange(range_m, nothing_from_mm));
  }
  return scan;
}

}  // namespace loci
