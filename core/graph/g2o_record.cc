// SPDX-License-Identifier: Apache-2.0
// The table of records, and reading of their fields.
#include "core/graph/g2o_record.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <system_error>

namespace loci {
namespace {

constexpr std::array<RecordLayout, 19> kLayouts = {{
    {"VERTEX_SE2", RecordKind::kNode, 1, 3},
    {"VERTEX2", RecordKind::kNode, 1, 3},
    {"VERTEX_XY", RecordKind::kPoint, 1, 2},
    {"VERTEX_SE3:QUAT", RecordKind::kSpaceNode, 1, 7},
    {"VERTEX_TRACKXYZ", RecordKind::kSpacePoint, 1, 3},
    {"EDGE_SE2", RecordKind::kConstraint, 2, 9},
    {"EDGE2", RecordKind::kConstraintOfToro, 2, 9},
    {"ODOMETRY", RecordKind::kConstraintByRoot, 2, 9},
    {"EDGE_SE2_XY", RecordKind::kPointConstraint, 2, 5},
    {"LANDMARK", RecordKind::kPointConstraintByRoot, 2, 5},
    {"EDGE_PRIOR_SE2", RecordKind::kPosePrior, 1, 9},
    {"EDGE_SE2_PRIOR", RecordKind::kPosePrior, 1, 9},
    {"EDGE_PRIOR_SE2_XY", RecordKind::kPositionPrior, 1, 5},
    {"EDGE_SE3:QUAT", RecordKind::kSpaceConstraint, 2, 28},
    {"EDGE_SE3_TRACKXYZ", RecordKind::kSpacePointConstraint, 3, 9},
    {"EDGE_SE3_PRIOR", RecordKind::kSpacePosePrior, 2, 28},
    {"EDGE_SE3_XYZ_PRIOR", RecordKind::kSpacePositionPrior, 2, 9},
    {"PARAMS_SE3OFFSET", RecordKind::kSpaceOffset, 1, 7},
    {"FIX", RecordKind::kFix, 0, 0},
}};

template <typename Number>
std::optional<Number> ParseNumber(std::string_view word) {
  if (word.size() > 1 && word.front() == '+') {
    word.remove_prefix(1);
  }
  Number number{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error != std::errc() || end != word.data() + word.size()) {
    return std::nullopt;
  }
  return number;
}

std::string Quoted(std::string_view text) {
  std::string quoted = "\"";
  quoted += text;
  return quoted += '"';
}

}  // namespace

const RecordLayout* FindRecordLayout(std::string_view tag) {
  const auto found = std::find_if(kLayouts.begin(), kLayouts.end(), [&](const RecordLayout& known) {
    return known.tag == tag;
  });
  return found == kLayouts.end() ? nullptr : &*found;
}

bool IsVertex(RecordKind kind) {
  return kind <= RecordKind::kSpacePoint;
}

bool IsOfSpace(RecordKind kind) {
  switch (kind) {
    case RecordKind::kSpaceNode:
    case RecordKind::kSpacePoint:
    case RecordKind::kSpaceConstraint:
    case RecordKind::kSpacePointConstraint:
    case RecordKind::kSpacePosePrior:
    case RecordKind::kSpacePositionPrior:
    case RecordKind::kSpaceOffset:
      return true;
    default:
      return false;
  }
}

std::vector<std::string_view> WordsOf(std::string_view line) {
  constexpr std::string_view kBlanks = " \t\r\v\f";
  line = line.substr(0, std::min(line.find('#'), line.size()));
  std::vector<std::string_view> words;
  for (std::size_t begin = line.find_first_not_of(kBlanks); begin != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(kBlanks, end);
  }
  return words;
}

StatusOr<Record> ParseRecord(std::size_t line,
                             std::span<const std::string_view> words,
                             const RecordLayout& layout) {
  const std::size_t id_count = layout.kind == RecordKind::kFix ? words.size() - 1 : layout.id_count;
  Record record{line, words.front(), layout.kind, {}, {}};
  if (words.size() != 1 + id_count + layout.number_count) {
    return LineError(record,
                     std::to_string(words.size() - 1) + " fields, must be " +
                         std::to_string(id_count + layout.number_count));
  }
  for (std::size_t i = 1; i <= id_count; ++i) {
    const std::optional<std::int64_t> id = ParseNumber<std::int64_t>(words[i]);
    if (!id.has_value()) {
      return LineError(record, Quoted(words[i]) + " is no id");
    }
    record.ids.push_back(*id);
  }
  record.numbers.reserve(layout.number_count);
  for (std::size_t i = 1 + id_count; i < words.size(); ++i) {
    const std::optional<double> number = ParseNumber<double>(words[i]);
    if (!number.has_value() || !std::isfinite(*number)) {
      return LineError(record, Quoted(words[i]) + " is no finite number");
    }
    record.numbers.push_back(*number);
  }
  return record;
}

Status LineError(const Record& record, const std::string& what) {
  return InvalidArgumentError("line " + std::to_string(record.line) + ": " +
                              std::string(record.tag) + ": " + what);
}

Pose2 PlanePose(const Record& record) {
  return {record.numbers[0], record.numbers[1], WrapAngle(record.numbers[2])};
}

StatusOr<Pose3> SpacePose(const Record& record) {
  const std::vector<double>& n = record.numbers;
  const Eigen::Quaterniond rotation(n[6], n[3], n[4], n[5]);
  if (!(rotation.norm() > 1e-3) || !std::isfinite(rotation.norm())) {
    return LineError(record, "the quaternion's norm must be near 1");
  }
  return Pose3{{n[0], n[1], n[2]}, rotation.normalized()};
}

Eigen::Matrix3d FromToroOrder(const double* numbers) {
  const double* n = numbers;
  const std::array<double, 6> upper = {n[0], n[1], n[4], n[2], n[5], n[3]};
  return FromUpper<3>(upper.data());
}

}  // namespace loci
