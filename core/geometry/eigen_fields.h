// SPDX-License-Identifier: Apache-2.0
// Fields of small Eigen types, for archives.
#pragma once

#include <Eigen/Core>

namespace loci {

template <typename Archive>
void Fields(Archive& archive, Eigen::Vector2d& vector) {
  archive(vector.x(), vector.y());
}

// All nine numbers, column by column.
template <typename Archive>
void Fields(Archive& archive, Eigen::Matrix3d& matrix) {
  for (Eigen::Index i = 0; i < matrix.size(); ++i) {
    archive(matrix.data()[i]);
  }
}

}  // namespace loci
