// SPDX-License-Identifier: Apache-2.0
// One line of a pose graph's text: which kinds of records there are, and what fields they have.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/base/status.h"
#include "core/geometry/se2.h"
#include "core/geometry/se3.h"

namespace loci {

enum class RecordKind : std::uint8_t {
  kNode,
  kPoint,
  kSpaceNode,
  kSpacePoint,
  kConstraint,
  kConstraintOfToro,  // EDGE2: its information depends on the rest of the file
  kConstraintByRoot,  // R of information R^T R
  kPointConstraint,
  kPointConstraintByRoot,
  kPosePrior,
  kPositionPrior,
  kSpaceConstraint,
  kSpacePointConstraint,
  kSpacePosePrior,
  kSpacePositionPrior,
  kSpaceOffset,  // a parameter
  kFix,
};

// A tag, how many ids follow it (of vertices, then of parameters), and how many numbers then.
struct RecordLayout {
  std::string_view tag;
  RecordKind kind = RecordKind::kFix;
  std::size_t id_count = 0;  // FIX has as many as it likes
  std::size_t number_count = 0;
};

// The layout of a known tag, or null.
const RecordLayout* FindRecordLayout(std::string_view tag);

bool IsVertex(RecordKind kind);
bool IsOfSpace(RecordKind kind);  // FIX is of neither

// A record as it stands in the file.
struct Record {
  std::size_t line = 0;
  std::string_view tag;
  RecordKind kind = RecordKind::kFix;
  std::vector<std::int64_t> ids;
  std::vector<double> numbers;
};

// The words of a line up to `#`.
std::vector<std::string_view> WordsOf(std::string_view line);

// Reads the fields after the tag. kInvalidArgument with the line, if they are too few or too many,
// an id is no whole number, or a number is none or not finite.
StatusOr<Record> ParseRecord(std::size_t line,
                             std::span<const std::string_view> words,
                             const RecordLayout& layout);

// kInvalidArgument: "line 7: TAG: what".
Status LineError(const Record& record, const std::string& what);

// x y theta; the angle is wrapped.
Pose2 PlanePose(const Record& record);
// x y z qx qy qz qw; an error unless the quaternion can be normalised.
StatusOr<Pose3> SpacePose(const Record& record);

// A symmetric matrix from its upper triangle, row by row.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> FromUpper(const double* numbers) {
  Eigen::Matrix<double, kSize, kSize> matrix;
  for (int row = 0; row < kSize; ++row) {
    for (int column = row; column < kSize; ++column) {
      matrix(row, column) = *numbers;
      matrix(column, row) = *numbers++;
    }
  }
  return matrix;
}

// R^T R from R's upper triangle.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> FromRoot(const double* numbers) {
  const Eigen::Matrix<double, kSize, kSize> root =
      FromUpper<kSize>(numbers).template triangularView<Eigen::Upper>();
  return root.transpose() * root;
}

// TORO's order: xx xy yy tt xt yt.
Eigen::Matrix3d FromToroOrder(const double* numbers);

}  // namespace loci
