// SPDX-License-Identifier: Apache-2.0
// Reads the scans of a log in CARMEN's format (carmen_message.h), plain, gzip or bzip2.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "clients/log/carmen_message.h"
#include "clients/log/carmen_survey.h"
#include "clients/log/line_source.h"
#include "clients/log/log_scan.h"
#include "core/base/status.h"

namespace loci {

struct CarmenReaderOptions {
  // What a line that cannot be read does: kStop ends reading with its error; kSkip counts it and
  // goes on. Damage to the compression itself ends the log in both; kSkip returns what came before
  // it and counts it as one more line.
  enum class OnError { kStop, kSkip };
  OnError on_error = OnError::kStop;
};

// Gives the scans in the order of the file; stamps may go back (StampSorter puts them in order).
//
// The file is read twice, since the laser's pose on the robot and the range that means "nothing
// seen" follow from the whole of it (CarmenSurvey). One thread at a time.
class CarmenReader {
 public:
  // Errors: those of OpenByteSource; kInvalidArgument if there is no laser scan in the file;
  // kDataLoss if there is none before its compressed stream breaks.
  static StatusOr<std::unique_ptr<CarmenReader>> Open(const std::string& path,
                                                      const CarmenReaderOptions& options = {});

  // The next scan; nothing at the end. An error names file and line, and comes again when asked
  // again: kInvalidArgument for a line, kDataLoss for a damaged or truncated stream.
  StatusOr<std::optional<LogScan>> Next();

  // Of the whole log.
  std::size_t scan_count() const { return survey_.scan_count(); }
  std::int64_t first_stamp_ns() const { return survey_.first_stamp_ns(); }
  std::int64_t last_stamp_ns() const { return survey_.last_stamp_ns(); }

  // So far.
  std::size_t skipped_count() const { return skipped_count_; }
  // Scans that came a second time, as FLASER and as ROBOTLASER1 of one stamp.
  std::size_t duplicate_count() const { return duplicate_count_; }

 private:
  CarmenReader(std::string path, const CarmenReaderOptions& options, LineSource lines);

  Status RunSurvey(LineSource& lines);
  Status AtLine(std::size_t line, const Status& status) const;
  LogScan ScanFrom(const CarmenLaser& laser, std::size_t line) const;
  bool IsDuplicate(const CarmenLaser& laser) const;

  std::string path_;
  CarmenReaderOptions options_;
  LineSource lines_;
  CarmenSurvey survey_;
  Pose2 robot_from_flaser_;
  Pose2 robot_from_robotlaser_;
  std::uint16_t nothing_from_mm_ = LogScan::kNothingSeen;
  std::optional<CarmenLaser::Kind> last_kind_;
  std::int64_t last_stamp_ns_ = 0;
  std::size_t skipped_count_ = 0;
  std::size_t duplicate_count_ = 0;
  bool at_end_ = false;
  Status status_;
};

}  // namespace loci
